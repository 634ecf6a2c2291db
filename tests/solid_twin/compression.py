"""Compression of a solid between two platens, in steps that shrink where they must."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from solid_twin.equilibrium import Body, Options
from solid_twin.platens import Press
from solid_twin.solid import Solid, SolidError

log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Step:
    """An equilibrium: nominal strain, positions (n, 3), force on the upper platen, cost."""

    strain: float
    x: np.ndarray
    force: float
    energy: float
    solves: int


class Compression:
    """A body between platens, at its last equilibrium."""

    def __init__(self, solid: Solid, press: Press, options: Options) -> None:
        self.points, self.press, self.options = solid.mesh.points, press, options
        held = press.held(self.points)
        self.body, self.others = Body(solid, held), np.flatnonzero(~held)
        self.last = Step(0.0, self.points.copy(), 0.0, 0.0, 0)

    def to(self, strain: float) -> Step:
        """The equilibrium at a nominal strain, near the last one."""
        last, press = self.last, self.press
        before, contact = (press.on(self.others, e) for e in (last.strain, strain))
        shift = press.shift(self.points, strain - last.strain)
        x, count = self.body.equilibrium(last.x, shift, before, contact, self.options)
        force = press.force(self.body.force(x, contact), self.points, contact, x)
        energy = self.body.energy(x, contact)
        self.last = Step(strain, x, force, energy, last.solves + count)
        return self.last


def compress(
    solid: Solid,
    press: Press,
    strains: list[float],
    options: Options | None = None,
    each: Callable[[Step], None] | None = None,
) -> list[Step]:
    """Equilibria at the nominal strains, in steps of at most `options.increment`.

    `each` is called with every step on the way. Raises SolidError, with the strain, where the
    increment falls below `options.least_increment`."""
    options = options or Options()
    run, increment, found = Compression(solid, press, options), options.increment, []
    for goal in strains:
        while (at := run.last.strain) < goal - 1e-12:
            target = min(at + increment, goal)
            try:
                step = run.to(target)
            except SolidError as error:
                increment = (target - at) / 2
                if increment < options.least_increment:
                    raise SolidError(f"at a strain of {at:.4f}: {error}") from error
                log.info("strain %.4f: %s", target, error)
                continue
            increment = min(1.5 * increment, options.increment)
            if each:
                each(step)
        found.append(run.last)
    return found
