"""Stable equilibrium of the beam network under given platens, by descent of its energy.

Newton's method on positions and rotations with a Cholesky factor. Where the tangent is not positive
definite, or a step does not lower the energy, a mass-like damping is raised until both hold: the
loop only ever descends, so that it passes buckling and snapping on to a stable equilibrium without
following unstable branches. Steps are clipped node by node, not as a whole: one buckling strut must
not hold up all others.

Tried and lost (default twin, 28.5 %): stresses as unknowns of their own in the tangent (as many
steps, each dearer); raising the damping for every step that goes up, without shortening it first
(64 against 48 s); guards of contact four times as stiff (twice as many steps).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from addvc.errors import AddvcError

from . import contact
from .beam import turned
from .motion import Motion
from .structure import Structure
from .tangent import Tangent, energies, linearise, newton_step, tangent_pattern

LONGEST, WIDEST = 4.0, 0.5
"""Largest move (voxels) and turn (radians) of a node in one step."""

TOLERANCE = 1e-7
"""An equilibrium is reached when an undamped step is shorter (rms over nodes, voxels)."""

ROUND_OFF = 1e-5
"""Steps shorter than this change the energy by no more than its round-off (rms, voxels)."""

MOST = 500
"""Most steps to an equilibrium."""

LEAST_DAMPING, MOST_DAMPING = 1e-4, 1e8
"""Of a node, force per voxel, where Young's modulus is one."""

ARM = 2.0
"""Length that turns rotations into moves in the damping (voxels)."""

SHARES = 0.5 ** np.arange(7)
"""Shares of a step that are tried before the damping is raised."""


class EquilibriumError(AddvcError):
    """No equilibrium of the network was found."""


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """Where a descent ended: reached or not, its steps, trials refused, last step (rms, voxels),
    the gradient (n, 6), which is minus the reaction at clamped nodes, and the tangent."""

    motion: Motion
    reached: bool
    steps: int
    refused: int
    last_step: float
    gradient: np.ndarray
    tangent: Tangent


@dataclass(frozen=True, eq=False)
class Step:
    """One step down: the new motion, its length before clipping, the damping it took."""

    motion: Motion
    length: float
    damping: float
    refused: int


def clipped(step: np.ndarray) -> np.ndarray:
    """A step (n, 6), shortened node by node."""
    move = np.linalg.norm(step[:, :3], axis=1) / LONGEST
    turn = np.linalg.norm(step[:, 3:], axis=1) / WIDEST
    return step / np.maximum(1.0, np.maximum(move, turn))[:, None]


def advanced(motion: Motion, step: np.ndarray) -> Motion:
    """The motion after a step (n, 6): nodes move, and turn about their own axes."""
    rotations = turned(motion.rotations, np.ascontiguousarray(step[:, 3:]))
    return replace(motion, positions=motion.positions + step[:, :3], rotations=rotations)


def mass_like(damping: float, count: int) -> np.ndarray | None:
    """Damping (n, 6), or None for none."""
    per_node = damping * np.array([1, 1, 1, ARM**2, ARM**2, ARM**2])
    return np.tile(per_node, (count, 1)) if damping else None


def raised(damping: float) -> float:
    """More damping; EquilibriumError where there is no hope."""
    if damping > MOST_DAMPING:
        raise EquilibriumError(
            f"the network cannot be held even by a damping of {damping:.0e} (limit "
            f"{MOST_DAMPING:.0e}): struts overlap; choose another twin.seed"
        )
    return max(LEAST_DAMPING, 4 * damping)


def lowered(damping: float) -> float:
    """Less damping, or none."""
    return damping / 8 if damping > LEAST_DAMPING else 0.0


def step_down(
    structure: Structure, motion: Motion, tangent: Tangent, gradient: np.ndarray, damping: float
) -> Step:
    """The first step that lowers the energy, over growing damping and shorter shares of it."""

    def energy(of):
        elastic, penalty = energies(structure, of, tangent.pairs)
        return elastic.sum() + penalty

    before, refused = energy(motion), 0
    while True:
        step = newton_step(tangent, gradient, mass_like(damping, len(gradient)))
        if step is not None:
            length = float(np.sqrt(np.mean(np.sum(step[:, :3] ** 2, axis=1))))
            step = clipped(step)
            for share in SHARES:
                new = advanced(motion, share * step)
                if length < ROUND_OFF or energy(new) <= before * (1 + 1e-10):
                    return Step(new, length, damping, refused)
                refused += 1
        damping, refused = raised(damping), refused + 1


def near(structure: Structure, motion: Motion, tangent: Tangent | None) -> Tangent:
    """The tangent itself while it has room for all pairs of beams that may touch, else another."""
    if tangent is not None:
        moved = np.abs(motion.positions - tangent.seen_at).max()
        if moved < contact.SKIN / 2:
            return tangent
    pairs = contact.near_pairs(structure.guards, structure.reference, motion.positions)
    if tangent is not None and set(map(tuple, pairs)) <= set(map(tuple, tangent.pairs)):
        return replace(tangent, seen_at=motion.positions)
    return tangent_pattern(structure, pairs, motion.positions)


def descend(structure: Structure, motion: Motion, tangent: Tangent) -> Equilibrium:
    """From a motion down to a stable equilibrium with its clamped nodes and platens held."""
    damping, refused, length = 0.0, 0, np.inf
    for count in range(1, MOST + 1):
        tangent = near(structure, motion, tangent)
        gradient = linearise(structure, motion, tangent)
        downhill = np.where(structure.clamped[:, None], 0.0, gradient)
        step = step_down(structure, motion, tangent, downhill, damping)
        motion, length, refused = step.motion, step.length, refused + step.refused
        if step.damping == 0 and length < TOLERANCE:
            return Equilibrium(motion, True, count, refused, length, gradient, tangent)
        damping = step.damping if step.refused else lowered(step.damping)
    return Equilibrium(motion, False, MOST, refused, length, gradient, tangent)


def predict(structure: Structure, motion: Motion, tangent: Tangent, move: float) -> Motion:
    """The linear response to the upper platen coming down by `move` (voxels).

    Clipped beyond the uniform compression, which carries whole regions far."""
    low, high = motion.platens
    height = np.clip((motion.positions[:, 1] - low) / (high - low), 0, 1)
    ramp = np.zeros((len(height), 6))
    ramp[:, 1] = -move * height
    push = np.where(structure.clamped[:, None], ramp, 0.0)
    gradient = linearise(structure, motion, tangent, push)
    gradient[structure.clamped] = 0
    damping = 0.0
    while (step := newton_step(tangent, gradient, mass_like(damping, len(height)))) is None:
        damping = raised(damping)
    step = np.where(structure.clamped[:, None], push, ramp + clipped(step - ramp))
    return replace(advanced(motion, step), platens=(low, high - move))
