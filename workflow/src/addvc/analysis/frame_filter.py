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
not (hinges, contacts, struts that were not seen) the misfit is more than noise: a weight counts only
if by Stein's estimate [Stein1981] the filtered displacement is nearer the truth than the measured one,

    |u - u_w|^2 - s^2 E|n|^2 + 2 s^2 E n . S n < s^2 E|n|^2,

even if the noise were s = 2 times that of the draws; else struts are measured as they are. The truth
of the twin is a network of beams too, which flatters the filter; hinging struts are the test against it.
"""

import logging
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from addvc.analysis.carried import NEAR, Attached, first_motion
from addvc.analysis.strut_frame import StrutFrame
from addvc.analysis.strut_table import RAW, Measured
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
"""By how much the noise may exceed its draws, which know of no robust weights and no lost struts."""

FEW = 4
"""Draws that choose the weight: each is a sum over all nodes."""

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
    """The motion of the frame with a weight; mean squares of the misfit and of what the filter takes
    from draws of the noise, voxel^2; the share of their square that it leaves; V(w); whether the
    filter helps."""

    weight: float
    motion: FrameMotion
    misfit: float
    taken: float
    kept: float
    validation: float
    helps: bool


def solver(matrix: sparse.csc_matrix) -> Callable[[np.ndarray], np.ndarray] | None:
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
        solve = solver(matrix)
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
    problem: Problem,
    motion: FrameMotion,
    weight: float,
    draws: np.ndarray,
    at: sparse.csr_matrix | None = None,
) -> np.ndarray:
    """What the filter leaves of draws (d, k, 3) of the noise, at the points or where a step of the
    frame moves others by the slopes `at` (3 q, 6 n): (d, q, 3)."""
    matrix, _, slopes = problem.system(motion, weight)
    solve, at = solver(matrix), slopes if at is None else at
    return np.stack([(at @ solve(slopes.T @ n.ravel())).reshape(-1, 3) for n in draws])


def judged(problem: Problem, motion: FrameMotion, weight: float, draws: np.ndarray) -> Fit:
    """The fit with what the filter does to draws (d, k, 3) of the noise."""
    left, noise = filtered(problem, motion, weight, draws), mean_square(draws)
    misfit, kept = mean_square(problem.error(motion)), mean_square(left) / noise
    cut = 1 - float(np.sum(left * draws) / np.sum(np.square(draws, dtype=float)))
    helps = misfit < 2 * DOUBTED**2 * cut * noise
    return Fit(weight, motion, misfit, mean_square(draws - left), kept, misfit / cut**2, helps)


def mean_square(x: np.ndarray) -> float:
    """Of the lengths of vectors (..., 3)."""
    return float(np.mean(np.sum(np.square(x, dtype=float), axis=-1)))


def best_fit(problem: Problem, motion: FrameMotion, draws: np.ndarray) -> Fit | None:
    """Over all weights, from the smallest on, the fit that cross-validation likes best of those that
    help; None where none has settled or helps."""
    best, motion = None, fitted(problem, motion, 0.0, RELAXED) or motion
    for weight in WEIGHTS:
        found = fitted(problem, motion, weight)
        if found is None:
            log.info("weight %.3g: not settled in %d iterations", weight, ITERATIONS)
            continue
        motion = found
        fit = judged(problem, motion, weight, draws)
        log.info("weight %.3g: misfit %.4f voxel, V^0.5 %.4f voxel, %s", weight, fit.misfit**0.5,
                 fit.validation**0.5, "helps" if fit.helps else "does not help")  # fmt: skip
        if fit.helps and (best is None or fit.validation < best.validation):
            best = fit
    return best


def balanced(
    held: StrutFrame, measured: Measured, valid: np.ndarray, nu: float
) -> tuple[Measured, dict]:
    """What was measured, with its draws of the noise, as the frame moves it at nodes within REACH, by
    those that are `valid` (n,); nothing changes where no motion is found. Notes: the weight, the rms
    misfit, by how much it exceeds what the noise at rest explains (the draws are scaled up so that it
    does explain it), the share of the noise that is left."""
    use = np.zeros(len(valid), dtype=bool)
    if len(held.frame.pieces):
        attached = Attached.of(held.frame, measured.points)
        near = attached.distance < REACH
        use = near & (valid > 0)
    fit = None
    if use.sum() > NEAR:
        points, draws = measured.points[use], measured.draws[:, use]
        problem = Problem(held, attached[use], points + measured.u[use], nu)
        fit = best_fit(problem, first_motion(held.frame, points, measured.u[use]), draws[:FEW])
    if fit is None:
        log.warning(
            "WARNING: no equilibrium of the frame explains the displacement better than noise does; "
            "struts are as measured"
        )
        return measured, {"weight": None}
    scale = max(1.0, (fit.misfit / fit.taken) ** 0.5)
    u, left = measured.u.copy(), measured.draws.copy()
    u[near] = attached[near].moved(fit.motion) - measured.points[near]
    left[:, near] = scale * filtered(
        problem, fit.motion, fit.weight, draws, attached[near].slopes(fit.motion)
    )
    return Measured(measured.points, u, left), {
        "weight": float(fit.weight), "misfit": fit.misfit**0.5, "misfit_over_noise": scale,
        "noise_left": fit.kept**0.5,
    }  # fmt: skip


def micro_fields(
    held: StrutFrame | None, measured: Measured, valid: np.ndarray, nu: float
) -> tuple[dict[str, Measured], dict | None]:
    """What struts are measured on, by the ending of its columns, and the notes of `balanced`; the
    measured displacement alone where there is no frame."""
    if held is None:
        return {"": measured}, None
    filtered_field, notes = balanced(held, measured, valid, nu)
    return {"": filtered_field, RAW: measured}, notes
