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
not (hinges, contacts, struts that were not seen) the misfit is more than noise. By Stein's estimate
[Stein1981] the filtered displacement is nearer the truth than the measured one where

    |u - u_w|^2 - s^2 E|n|^2 + 2 s^2 E n . S n < s^2 E|n|^2,

s: the noise over that of its draws. More noise lets more misfit pass, and a weight counts if this holds
for s = 2: the filter is refused only where it would do harm even if the noise were twice its draws.
The truth of the twin is a network of beams too, which flatters the filter; hinging struts are the test
against it.
"""

import logging
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from addvc.analysis.carried import Attached
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

DOUBTED = 2.0
"""By how much the noise may exceed its draws, which know of no robust weights and no lost struts; the
more, the more misfit is put down to it."""

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
        scale = middle(data)
        w, mu = weight * scale / middle(balance), held * scale / middle(stiff)
        right = slopes.T @ self.error(motion).ravel() - w * (gap.T @ (self.gap @ load)) - mu * load
        damping = DAMPED * scale * sparse.identity(len(right))
        return (data + w * balance + mu * stiff + damping).tocsc(), right, slopes


def middle(matrix: sparse.spmatrix) -> float:
    """Median of what is not zero in the diagonal."""
    diagonal = matrix.diagonal()
    return float(np.median(diagonal[diagonal > 0]))


Solve = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False)
class Fit:
    """The motion of the frame with a weight; mean squares of the misfit, of the greatest with which the
    filter may help, and of what it takes from draws of the noise, voxel^2; the share of their square
    that it leaves; V(w); how the frame follows points, by their slopes (3 k, 6 n)."""

    weight: float
    motion: FrameMotion
    misfit: float
    bound: float
    taken: float
    kept: float
    validation: float
    solve: Solve
    slopes: sparse.csr_matrix

    @property
    def helps(self) -> bool:
        """Whether the filter brings the displacement nearer the truth, if the noise is DOUBTED times
        its draws."""
        return self.misfit < self.bound

    @property
    def excess(self) -> float:
        """The misfit over what the noise explains, at least one."""
        return max(1.0, (self.misfit / self.taken) ** 0.5)

    def left(self, draws: np.ndarray, at: sparse.csr_matrix | None = None) -> np.ndarray:
        """What the filter leaves of draws (d, k, 3) of the noise, at the points or where a step of the
        frame moves others by the slopes `at` (3 q, 6 n): (d, q, 3)."""
        return filtered(self.solve, self.slopes, draws, at)


def solver_or_none(matrix: sparse.csc_matrix) -> Solve | None:
    """x (N,) of matrix (N, N) x = b, for any b; None where it is not positive definite. Pivots are not
    looked at, as `fem.solver` does: squared equations of balance are all but singular, and
    Gauss-Newton mends what is lost."""
    from sksparse.cholmod import CholmodNotPositiveDefiniteError, cholesky

    try:
        return cholesky(matrix, ordering_method="metis").solve_A
    except CholmodNotPositiveDefiniteError:
        return None


def fitted(
    problem: Problem, motion: FrameMotion, weight: float, held: float = HELD
) -> FrameMotion | None:
    """The motion that is best with this weight, from another one; None where none is found."""
    for _ in range(ITERATIONS):
        matrix, right, slopes = problem.system(motion, weight, held)
        solve = solver_or_none(matrix)
        if solve is None:
            return None
        step = solve(right)
        carried = np.sqrt(mean_square((slopes @ step).reshape(-1, 3)))
        step = step.reshape(-1, 6)
        longest = np.abs(step).max(axis=1, keepdims=True)
        motion = motion.moved(step * np.minimum(1, LONGEST / np.maximum(longest, LONGEST)))
        if carried < SETTLED:
            return motion
    return None


def filtered(
    solve: Solve, slopes: sparse.csr_matrix, draws: np.ndarray, at: sparse.csr_matrix | None = None
) -> np.ndarray:
    """What of draws (d, k, 3) the frame follows, at the points of slopes (3 k, 6 n) or at others of
    slopes `at` (3 q, 6 n): (d, q, 3)."""
    at = slopes if at is None else at
    return np.stack([(at @ solve(slopes.T @ n.ravel())).reshape(-1, 3) for n in draws])


def judged(problem: Problem, motion: FrameMotion, weight: float, draws: np.ndarray) -> Fit | None:
    """The fit with what the filter does to draws (d, k, 3) of the noise, not all of them zero; None
    where the matrix is not positive definite."""
    matrix, _, slopes = problem.system(motion, weight)
    solve = solver_or_none(matrix)
    if solve is None:
        return None
    left, noise = filtered(solve, slopes, draws), mean_square(draws)
    misfit, kept = mean_square(problem.error(motion)), mean_square(left) / noise
    cut = 1 - float(np.sum(left * draws) / np.sum(np.square(draws, dtype=float)))
    bound, taken = 2 * DOUBTED**2 * cut * noise, mean_square(draws - left)
    return Fit(weight, motion, misfit, bound, taken, kept, misfit / cut**2, solve, slopes)


def mean_square(x: np.ndarray) -> float:
    """Of the lengths of vectors (..., 3)."""
    return float(np.mean(np.sum(np.square(x, dtype=float), axis=-1)))


def best_fit(problem: Problem, motion: FrameMotion, draws: np.ndarray) -> Fit | None:
    """Over all weights, from the smallest on, the fit that cross-validation likes best of those that
    help; where none does, of all; None where none has settled."""
    fits, motion = [], fitted(problem, motion, 0.0, RELAXED) or motion
    for weight in WEIGHTS:
        found = fitted(problem, motion, weight)
        fit = judged(problem, found, weight, draws) if found else None
        if fit is None:
            log.info("weight %.3g: not settled in %d iterations", weight, ITERATIONS)
            continue
        motion = fit.motion
        log.info("weight %.3g: misfit %.4f voxel, V^0.5 %.4f voxel, %s", weight, fit.misfit**0.5,
                 fit.validation**0.5, "helps" if fit.helps else "does not help")  # fmt: skip
        fits.append(fit)
    return min(fits, key=lambda fit: (not fit.helps, fit.validation), default=None)
