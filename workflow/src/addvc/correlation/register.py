"""One mesh, two images: what Gauss-Newton needs, put together once and used for every state."""

import logging
from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from addvc.correlation.gauss_newton import Solution, gauss_newton
from addvc.correlation.metric import (
    Reference,
    geman_mcclure,
    residual,
    residual_statistics,
    right_hand_side,
)
from addvc.fem.solver import ConjugateGradients, Factor

log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class System:
    """S(u) + u^T M u + 2 u^T f on one mesh: I_r sampled, M, and what solves A = H + M.

    `load` f (3 n,): of a regularisation that is not at rest at u = 0. `scale` s of the residual
    (grey levels): S is then the robust one of Geman and McClure."""

    reference: Reference
    regularisation: sparse.spmatrix | None
    factor: Factor | ConjugateGradients
    load: np.ndarray | None = None
    scale: float | None = None


@dataclass(frozen=True)
class Stop:
    """When a loop ends: rms(du) below `tolerance` voxels, or `max_iterations`."""

    tolerance: float = 1e-3
    max_iterations: int = 50


def register(
    system: System, deformed: np.ndarray, u: np.ndarray, stop: Stop, name: str = "DVC"
) -> Solution:
    """Eq. 3 for I_d given by its spline coefficients (nx, ny, nz), from u (n, 3)."""
    reference = system.reference
    sigma = {}

    def downhill(field_):
        r, inside = residual(reference, deformed, field_)
        sigma["now"] = residual_statistics(r, inside, reference.quadrature.weight)["std"]
        if system.scale is not None:
            r = r * geman_mcclure(r, system.scale)
        b = right_hand_side(reference, r)
        if system.load is not None:
            b -= system.load
        if system.regularisation is not None:
            b -= system.regularisation @ field_.ravel()
        return b

    def progress(iteration, step):
        log.info(
            "%s: iteration %d, rms(du) %.2e voxel, sigma(r) %.3f before it",
            name,
            iteration,
            step,
            sigma["now"],
        )

    solution = gauss_newton(
        downhill, system.factor.solve, u, stop.tolerance, stop.max_iterations, progress
    )
    r, inside = residual(reference, deformed, solution.u)
    statistics = residual_statistics(r, inside, reference.quadrature.weight)
    log.info(
        "%s: %s after %d iterations, sigma(r) %.3f",
        name,
        "converged" if solution.converged else "NOT converged",
        solution.iterations,
        statistics["std"],
    )
    return replace(solution, residual=statistics)
