"""A stage of micro DVC by `corotational`: what it is, its system, its Gauss-Newton loop."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from addvc.correlation.gauss_newton import Solution
from addvc.correlation.metric import Reference, hessian, turned
from addvc.correlation.register import Stop, System, register
from addvc.correlation.torn import SOFT, Joint, layers
from addvc.fem.assembly import node_pattern
from addvc.fem.operators import corotational_load, stiffness
from addvc.fem.rotations import smooth_rotations
from addvc.fem.solver import factorise

EARLY = 10
"""Tolerance of a stage that is not the last, over that of the last."""

EARLY_MOST = 10
"""Iterations of such a stage, at most: its rotations are not the last ones."""


@dataclass(frozen=True)
class Stage:
    """One Gauss-Newton loop: its frame, the scale of its residuals (grey levels), its end."""

    rotated: bool = True
    scale: float | None = None
    stop: Stop = field(default_factory=Stop)


Step = tuple[Solution, dict]
"""A stage that has been run, and its row of figures."""


def early(last: Stop) -> Stop:
    """The end of a stage before the last, whose own end is `last`: never more iterations than that."""
    return Stop(EARLY * last.tolerance, min(EARLY_MOST, last.max_iterations))


@dataclass(frozen=True, eq=False)
class Problem:
    """What all states share: I_r on struts and shell, c of the energy and the l_E (voxels) that it
    stands for, nu, order of elimination, bridges; those of these that a state tears; the stiffness of
    the others over that of other struts."""

    reference: Reference
    weight: float
    nu: float
    cutoff: float = 1.0
    order: np.ndarray | None = None
    smoothing: int = 4
    joints: Sequence[Joint] = ()
    cuts: Sequence[Joint] = ()
    bridge: float = 1.0

    @property
    def modulus(self) -> np.ndarray | float:
        """Young's modulus of each cell (m,), or of all, over that of the solid."""
        if not self.joints:
            return 1.0
        found = np.where(np.any([joint.around for joint in self.joints], axis=0), self.bridge, 1.0)
        return np.where(layers(self.cuts), SOFT, found) if self.cuts else found

    def tear(self, cuts: Sequence[Joint]) -> "Problem":
        """With these bridges cut: the points of their layers do not count, and these are SOFT."""
        if not cuts:
            return self
        q = self.reference.quadrature
        left = replace(q, weight=q.weight * ~layers(cuts)[q.cell])
        return replace(self, reference=replace(self.reference, quadrature=left), cuts=cuts)

    def cut_off(self, times: float) -> "Problem":
        """With `times` the l_E: c goes with its square (`regularisation.elastic_weight`)."""
        return replace(self, weight=self.weight * times**2, cutoff=self.cutoff * times)


def stage_system(problem: Problem, stage: Stage, u: np.ndarray | None) -> System:
    """The system of a stage that starts from u (n, 3), with the rotations of u where it is rotated.

    H has no robust weights: they only fall from one, so that A then bounds the curvature from above
    and each step goes down. With the weights of u in H, points whose residual fell during the stage
    were stepped over back and forth."""
    mesh, pattern = problem.reference.mesh, node_pattern(problem.reference.mesh)
    rotation = smooth_rotations(mesh, u, problem.smoothing) if stage.rotated else None
    reference, load = problem.reference, None
    if rotation is not None:
        reference = turned(reference, rotation)
        load = problem.weight * corotational_load(mesh, problem.nu, rotation, problem.modulus)
    energy = problem.weight * stiffness(mesh, problem.nu, pattern, rotation, problem.modulus)
    factor = factorise(hessian(reference, pattern) + energy, problem.order)
    return System(reference, energy, factor, load, stage.scale)


def run(
    problem: Problem,
    stage: Stage,
    deformed: np.ndarray,
    u: np.ndarray,
    name: str = "micro DVC",
    system: System | None = None,
) -> tuple[Solution, dict]:
    """One stage from u (n, 3), and its row of figures; `system`: its own, where it is known."""
    system = stage_system(problem, stage, u) if system is None else system
    solution = register(system, deformed, u, stage.stop, name)
    return solution, {
        "stage": name,
        "rotated": stage.rotated,
        "scale": stage.scale,
        "points": int(np.count_nonzero(system.reference.quadrature.weight)),
        "iterations": solution.iterations,
        "converged": solution.converged,
        "residual_std": solution.residual["std"],
        "factor_nonzeros": system.factor.nonzeros,
    }
