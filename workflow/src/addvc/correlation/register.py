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
    downhill = Downhill(system, deformed)

    def progress(iteration: int, step: float) -> None:
        words = "%s: iteration %d, rms(du) %.2e voxel, sigma(r) %.3f before it"
        log.info(words, name, iteration, step, downhill.sigma)

    solution = gauss_newton(
        downhill, system.factor.solve, u, stop.tolerance, stop.max_iterations, progress
    )
    r, inside = residual(system.reference, deformed, solution.u)
    statistics = residual_statistics(r, inside, system.reference.quadrature.weight)
    log.info("%s: %s, sigma(r) %.3f", name, ending(solution, stop), statistics["std"])
    return replace(solution, residual=statistics)


class Downhill:
    """b(u) (3 n,), Eq. 5 less what the regularisation holds against; `sigma`: standard deviation of the
    residual at the last u, grey levels."""

    def __init__(self, system: System, deformed: np.ndarray) -> None:
        self.system, self.deformed, self.sigma = system, deformed, np.nan

    def __call__(self, u: np.ndarray) -> np.ndarray:
        system = self.system
        r, inside = residual(system.reference, self.deformed, u)
        self.sigma = residual_statistics(r, inside, system.reference.quadrature.weight)["std"]
        return pull(system, r) - forces(system, u)


def pull(system: System, r: np.ndarray) -> np.ndarray:
    """Where residuals r (Q,) pull (3 n,): those far beyond the scale of the system hardly do."""
    if system.scale is not None:
        r = r * geman_mcclure(r, system.scale)
    return right_hand_side(system.reference, r)


def forces(system: System, u: np.ndarray) -> np.ndarray:
    """M u + f (3 n,): what the regularisation holds against u (n, 3)."""
    held = np.zeros(u.size) if system.load is None else system.load
    return held if system.regularisation is None else held + system.regularisation @ u.ravel()


def ending(solution: Solution, stop: Stop) -> str:
    """How a loop ended. What a limit of iterations means is the caller's to tell: a start on trial is
    not meant to converge."""
    if solution.converged:
        return f"converged after {solution.iterations} iterations"
    return (
        f"stopped after {solution.iterations} iterations, rms(du) {solution.history[-1]:.1e} voxel "
        f"(criterion {stop.tolerance:.0e})"
    )
