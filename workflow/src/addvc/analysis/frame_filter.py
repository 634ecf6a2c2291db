"""The measured displacement less what no frame of struts in equilibrium can do.

Noise of a tenth of a voxel stretches struts more than loads do where they bend. But struts carry no
load between their ends, and those that meet balance each other. So of all motions q of the frame
(`strut_frame`) that is sought which minimises

    sum_k |u_k - u_k(q)|^2 + w |D f(q)|^2

over the nodes k of the mesh; f: the loads that the nodes of the frame would need, forces times half the
length of a strut, and moments; D leaves out where the frame is cut. The weight w is that with the least
generalised cross-validation [Golub1979]

    V(w) = |u - u_w|^2 / (1 - c)^2,    c = E n . S n / E |n|^2,

S n being what the filter keeps of draws n of the noise, so that neither a truth nor the level of the
noise is needed. Assumed are slender elastic struts of one stiffness, without contacts. Where they are
not (hinges, contacts, struts that were not seen) the misfit grows with w, and a smaller w is chosen.
"""

import logging
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from sksparse.cholmod import CholmodNotPositiveDefiniteError, cholesky

from addvc.analysis.carried import Attached, first_motion
from addvc.analysis.strut_frame import StrutFrame
from addvc.fem.frame import FrameMotion, forces

log = logging.getLogger(__name__)

WEIGHTS = 10.0 ** np.arange(1, 6.1, 0.5)
"""Over the ratio of the medians of the diagonals of both terms; each is tried from the motion that
the one before has led to."""

HELD, RELAXED = 1e-5, 1e-2
"""Weight of the elastic energy, likewise: of nodes that nothing else holds, and where they start."""

DAMPED = 1e-4
"""Of the steps [Levenberg1944], likewise: a strut that carries no node of the mesh is swung about by
little at a time."""

REACH = 3.5
"""Farthest node of the mesh that moves with the frame, voxels from its axis."""

ITERATIONS, SETTLED = 8, 5e-3
"""Of Gauss-Newton for each weight, at most, and the rms of the last step of the nodes of the mesh,
voxels: a twentieth of the noise."""

LONGEST = 2.0
"""Step of a node of the frame, voxels or radians."""


@dataclass(frozen=True, eq=False)
class Problem:
    """A frame with points (k, 3) attached to it that are `now` (k, 3); nu: Poisson's ratio."""

    held: StrutFrame
    attached: Attached
    now: np.ndarray
    nu: float

    def __post_init__(self) -> None:
        free = ~self.held.loaded[:, None]
        rows = (free * ([self.held.span / 2] * 3 + [1.0] * 3)).ravel()
        object.__setattr__(self, "gap", sparse.diags(rows))

    def error(self, motion: FrameMotion) -> np.ndarray:
        """(k, 3) voxels: how far the points are from where the frame carries them."""
        return self.now - self.attached.moved(motion)

    def system(
        self, motion: FrameMotion, weight: float, held: float = HELD
    ) -> tuple[sparse.csc_matrix, np.ndarray, sparse.csr_matrix]:
        """The matrix of Gauss-Newton (6 n, 6 n), its right-hand side (6 n,), the slopes (3 k, 6 n)."""
        slopes = self.attached.slopes(motion)
        load, stiff = forces(self.held.frame, motion, self.nu)
        gap = self.gap @ stiff
        data, balance = (slopes.T @ slopes).tocsc(), (gap.T @ gap).tocsc()
        scale = np.median(data.diagonal())
        w, mu = weight * scale / middle(balance), held * scale / middle(stiff)
        right = slopes.T @ self.error(motion).ravel() - w * (gap.T @ (self.gap @ load)) - mu * load
        damping = DAMPED * scale * sparse.identity(len(right))
        return (data + w * balance + mu * stiff + damping).tocsc(), right, slopes


def middle(matrix: sparse.spmatrix) -> float:
    """Median of what is not zero in the diagonal."""
    diagonal = matrix.diagonal()
    return float(np.median(diagonal[diagonal > 0]))


@dataclass(frozen=True, eq=False)
class Fit:
    """The motion of the frame with a weight; what is left (d, k, 3) of draws of the noise at the
    points; the mean squares of the misfit and of what the filter takes from the draws, voxel^2;
    V: generalised cross-validation."""

    weight: float
    motion: FrameMotion
    left: np.ndarray
    misfit: float
    taken: float
    validation: float


def solver(matrix: sparse.csc_matrix) -> Callable[[np.ndarray], np.ndarray]:
    """x (N,) of matrix (N, N) x = b, for any b. Its pivots are not looked at, as `fem.solver` does:
    squared equations of balance are all but singular, and Gauss-Newton mends what is lost."""
    return cholesky(matrix, ordering_method="metis").solve_A


def fitted(
    problem: Problem, motion: FrameMotion, weight: float, held: float = HELD
) -> FrameMotion | None:
    """The motion that is best with this weight, from another one; None where none is found."""
    for _ in range(ITERATIONS):
        matrix, right, slopes = problem.system(motion, weight, held)
        try:
            step = solver(matrix)(right)
        except CholmodNotPositiveDefiniteError:
            return None
        carried = np.sqrt(mean_square((slopes @ step).reshape(-1, 3)))
        step = step.reshape(-1, 6)
        longest = np.abs(step).max(axis=1, keepdims=True)
        motion = motion.moved(step * np.minimum(1, LONGEST / np.maximum(longest, LONGEST)))
        if carried < SETTLED:
            return motion
    return None


def judged(problem: Problem, motion: FrameMotion, weight: float, draws: np.ndarray) -> Fit:
    """The fit with what the filter does to draws (d, k, 3) of the noise."""
    matrix, _, slopes = problem.system(motion, weight)
    solve = solver(matrix)
    left = np.stack([slopes @ solve(slopes.T @ n.ravel()) for n in draws]).reshape(draws.shape)
    misfit = mean_square(problem.error(motion))
    kept = np.sum(left * draws) / np.sum(np.square(draws))
    return Fit(weight, motion, left, misfit, mean_square(draws - left), misfit / (1 - kept) ** 2)


def mean_square(x: np.ndarray) -> float:
    """Of the lengths of vectors (..., 3)."""
    return float(np.mean(np.sum(np.square(x, dtype=float), axis=-1)))


def best_fit(problem: Problem, motion: FrameMotion, draws: np.ndarray) -> Fit | None:
    """Over all weights, from the smallest on, the fit that cross-validation likes best; None where none
    has settled."""
    best, motion = None, fitted(problem, motion, 0.0, RELAXED) or motion
    for weight in WEIGHTS:
        found = fitted(problem, motion, weight)
        if found is None:
            log.info("weight %.3g: not settled in %d iterations", weight, ITERATIONS)
            continue
        motion = found
        fit = judged(problem, motion, weight, draws)
        log.info("weight %.3g: misfit %.4f voxel, V^0.5 %.4f voxel", weight,
                 fit.misfit**0.5, fit.validation**0.5)  # fmt: skip
        if best is None or fit.validation < best.validation:
            best = fit
    return best


@dataclass(frozen=True, eq=False)
class Balanced:
    """The displacement (n, 3) of the nodes of a mesh and the draws (d, n, 3) of its noise, filtered;
    `notes`: weight, share of the noise that is left, rms misfit, over what noise explains."""

    u: np.ndarray
    draws: np.ndarray
    notes: dict


def balanced(
    held: StrutFrame, points: np.ndarray, u: np.ndarray, valid: np.ndarray, draws: np.ndarray, nu: float
) -> Balanced:
    """The motion of the frame at nodes (n, 3) of a mesh within REACH of it, from u (n, 3) at those that
    are `valid` (n,). What is left of the draws (d, n, 3) is scaled up where the noise at rest does not
    explain the misfit. Nothing changes where no motion was found."""
    attached = Attached.of(held.frame, points)
    near = attached.distance < REACH
    use = near & (valid > 0)
    problem = Problem(held, attached[use], points[use] + u[use], nu)
    fit = best_fit(problem, first_motion(held.frame, points[use], u[use]), draws[:, use])
    if fit is None:
        log.warning("WARNING: no equilibrium of the frame was found; struts are as measured")
        return Balanced(u, draws, {"weight": None})
    scale = max(1.0, (fit.misfit / fit.taken) ** 0.5)
    matrix, _, slopes = problem.system(fit.motion, fit.weight)
    solve, all_slopes = solver(matrix), attached[near].slopes(fit.motion)
    out, left = u.copy(), draws.copy()
    out[near] = attached[near].moved(fit.motion) - points[near]
    for one, n in zip(left, draws[:, use], strict=True):
        one[near] = scale * (all_slopes @ solve(slopes.T @ n.ravel())).reshape(-1, 3)
    return Balanced(out, left, {
        "weight": fit.weight, "misfit": fit.misfit**0.5, "misfit_over_noise": scale,
        "noise_left": (mean_square(fit.left) / mean_square(draws[:, use])) ** 0.5,
    })  # fmt: skip
