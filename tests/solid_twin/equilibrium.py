"""Stable equilibria of a solid between two platens: Newton's method that only goes down in energy.

Where the tangent is not positive definite, damping (energy per volume and voxel^2) is added until
it is, so that a step always leads downhill; it fades as soon as steps succeed, and a state counts
only when the last step was taken without any. Each node is clipped on its own: a cap on the
whole step would stall a large model for the sake of one snapping strut.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solid_twin.platens import Contact
from solid_twin.solid import Solid, SolidError
from solid_twin.system import System

LEAST_DAMPING, MOST_DAMPING = 1e-6, 1e2
"""Times Young's modulus, per voxel^2: the first damping tried, and where Newton gives up."""

ARMIJO = 1e-4
ROUND_OFF = 1e-11
"""Share of the energy below which its changes are not told from rounding."""


@dataclass(frozen=True)
class Options:
    """Newton stops when no node moved more than `tolerance` (voxels) in an undamped step.

    `clip`: most that a node moves in a step, voxels; `iterations`: most steps for a strain
    increment, which is halved when they do not do, down to `least_increment`."""

    tolerance: float = 1e-5
    clip: float = 1.0
    iterations: int = 40
    increment: float = 0.01
    least_increment: float = 1e-4


class Body:
    """A solid with nodes that are held and, where there are platens, others that may touch them."""

    def __init__(self, solid: Solid, held: np.ndarray) -> None:
        """`held` (n,) bool: nodes whose position is given."""
        self.solid, self.held = solid, held
        self.system = System(solid, ~held)
        pattern = solid.pattern
        rows = np.repeat(np.arange(len(held)), np.diff(pattern.indptr))
        self._diagonal = np.flatnonzero(rows == pattern.indices)

    def energy(self, x: np.ndarray, contact: Contact | None) -> float:
        """Stored energy and that of contact."""
        return self.solid.energy(x) + (contact.energy(x) if contact else 0.0)

    def force(self, x: np.ndarray, contact: Contact | None) -> np.ndarray:
        """(n, 3) gradient; on held nodes it is the reaction."""
        return self.solid.force(x) + (contact.force(x) if contact else 0.0)

    def tangent(self, x: np.ndarray, contact: Contact | None) -> np.ndarray:
        """Blocks (nnz, 3, 3) of the Hessian."""
        blocks = self.solid.tangent(x)
        if contact:
            blocks[self._diagonal[contact.touching(x)], 1, 1] += contact.stiffness
        return blocks

    def equilibrium(
        self,
        x: np.ndarray,
        shift: np.ndarray,
        before: Contact | None = None,
        contact: Contact | None = None,
        options: Options | None = None,
    ) -> tuple[np.ndarray, int]:
        """Stable equilibrium after the held nodes moved by `shift` (n, 3) and platens to those of
        `contact`, from the equilibrium x (n, 3) with the platens of `before`.

        Returns positions and the number of factorisations. Raises SolidError when there is none
        within `options.iterations`."""
        options = options or Options()
        x, damping = self._predicted(x, shift, before, contact)
        for count in range(2, options.iterations + 2):
            gradient = self.force(x, contact)
            gradient[self.held] = 0
            damping = self._factorise(self.tangent(x, contact), damping)
            step = self.system.solve(-gradient)
            step = step * np.minimum(1, options.clip / np.maximum(_length(step), 1e-300))[:, None]
            x, share = self._descend(x, step, gradient, contact)
            if share * _length(step).max() < options.tolerance and damping == 0:
                return x, count
            damping = self._next(damping, share)
        raise SolidError(
            f"no equilibrium after {options.iterations} steps (largest step "
            f"{_length(step).max():.1e} voxel, limit {options.tolerance:.0e}; damping "
            f"{damping:.0e}, limit 0); use a smaller increment"
        )

    def _predicted(
        self, x: np.ndarray, shift: np.ndarray, before: Contact | None, contact: Contact | None
    ) -> tuple[np.ndarray, float]:
        """The first step, linear in the motion of held nodes and platens, and its damping.

        The nodes in contact stay those of before: a node that the new face has passed, and that
        will follow its neighbours, must not be pressed against the face."""
        blocks = self.tangent(x, before)
        right = -self.force(x, before) - (self.solid.matrix(blocks) @ shift.ravel()).reshape(-1, 3)
        if before and contact:
            right -= before.change(x, contact)
        damping = self._factorise(blocks, 0.0)
        moved = x + np.where(self.held[:, None], shift, self.system.solve(right))
        if not np.isfinite(self.solid.energy(moved)):
            raise SolidError(
                "the first step turns elements inside out; use a smaller increment than "
                f"{np.abs(shift).max():.2g} voxel"
            )
        return moved, damping

    def _factorise(self, blocks: np.ndarray, damping: float) -> float:
        """The damping with which the tangent is positive definite, at least the one given."""
        young = self.solid.material.young
        while not self.system.factorise(blocks, young * damping):
            damping = max(10 * damping, LEAST_DAMPING)
            if damping > MOST_DAMPING:
                raise SolidError(
                    f"the tangent is not positive definite at a damping of {damping:.0e} (limit "
                    f"{MOST_DAMPING:.0e}); a part of the mesh may hang in the air"
                )
        return damping

    def _descend(
        self, x: np.ndarray, step: np.ndarray, gradient: np.ndarray, contact: Contact | None
    ) -> tuple[np.ndarray, float]:
        """x + share step, the share halved until the energy falls [Armijo]; share 0 if it never
        does."""
        start, slope = self.energy(x, contact), float(np.sum(gradient * step))
        share = 1.0
        while share > 1e-3:
            energy = self.energy(x + share * step, contact)
            if energy <= start + ARMIJO * share * min(slope, 0) + ROUND_OFF * abs(start):
                return x + share * step, share
            share /= 2
        return x, 0.0

    def _next(self, damping: float, share: float) -> float:
        """More damping after a step that was cut, ten times less after a whole one."""
        if share < 0.25:
            return max(10 * damping, LEAST_DAMPING)
        return damping / 10 if damping >= 10 * LEAST_DAMPING else 0.0


def _length(vectors: np.ndarray) -> np.ndarray:
    return np.linalg.norm(vectors, axis=1)
