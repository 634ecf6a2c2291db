"""Micro DVC beyond small strain: a weak elastic energy in a frame that turns with the struts.

The functional is S(u) + c (u^T K_R u + 2 u^T f_R): S over the struts and their shell, robust; the
energy of each tetrahedron measured from its own rotation R, so that a strut that turns as a whole
costs nothing; the gradient R grad I_r. R is smoothed and frozen within a stage: a stage then is the
modified Gauss-Newton of Eq. 3, with one factor, of the sparsity of K. A stage is data, and micro
DVC a fold over stages.
"""

import logging
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from addvc.correlation.gauss_newton import Solution
from addvc.correlation.metric import Reference, hessian, turned
from addvc.correlation.register import Stop, System, register
from addvc.fem.assembly import node_pattern
from addvc.fem.operators import corotational_load, stiffness
from addvc.fem.rotations import smooth_rotations
from addvc.fem.solver import factorise

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Stage:
    """One Gauss-Newton loop: its frame, the scale of its residuals (grey levels), its end."""

    rotated: bool = True
    scale: float | None = None
    stop: Stop = field(default_factory=Stop)


@dataclass(frozen=True, eq=False)
class Problem:
    """What all states share: I_r on struts and shell, c of the energy, nu, order of elimination."""

    reference: Reference
    weight: float
    nu: float
    order: np.ndarray | None = None
    smoothing: int = 4


def stage_system(problem: Problem, stage: Stage, u: np.ndarray) -> System:
    """The system of a stage that starts from u (n, 3), with the rotations of u.

    H has no robust weights: they only fall from one, so that A then bounds the curvature from above
    and each step goes down. With the weights of u in H, points whose residual fell during the stage
    were stepped over back and forth."""
    mesh, pattern = problem.reference.mesh, node_pattern(problem.reference.mesh)
    rotation = smooth_rotations(mesh, u, problem.smoothing) if stage.rotated else None
    reference, load = problem.reference, None
    if rotation is not None:
        reference = turned(reference, rotation)
        load = problem.weight * corotational_load(mesh, problem.nu, rotation)
    energy = problem.weight * stiffness(mesh, problem.nu, pattern, rotation)
    factor = factorise(hessian(reference, pattern) + energy, problem.order)
    return System(reference, energy, factor, load, stage.scale)


def corotational(
    problem: Problem, deformed: np.ndarray, u: np.ndarray, stages: Sequence[Stage]
) -> tuple[Solution, list[dict]]:
    """Stages one after the other from u (n, 3); I_d by its spline coefficients (nx, ny, nz).

    The solution has the history of all stages and converged if the last one did; a row of figures
    for each stage."""
    history, rows, seconds = [], [], 0.0
    for number, stage in enumerate(stages, 1):
        system = stage_system(problem, stage, u)
        solution = register(system, deformed, u, stage.stop, f"micro DVC, stage {number}")
        u, seconds = solution.u, seconds + solution.seconds
        history += solution.history
        rows.append(
            {
                "rotated": stage.rotated,
                "scale": stage.scale,
                "iterations": solution.iterations,
                "converged": solution.converged,
                "residual_std": solution.residual["std"],
                "factor_nonzeros": system.factor.nonzeros,
            }
        )
    return replace(solution, history=history, seconds=seconds), rows
