"""The measured displacement less what no frame of struts in equilibrium can do.

The displacement u of the nodes of the mesh is fitted by motions of the frame near equilibrium
(`correlation.frame_fit`), u_w with the weight w, which is that with the least generalised
cross-validation [Golub1979]

    V(w) = |u - u_w|^2 / (1 - c)^2,    c = E n . S n / E |n|^2,

S n being what the filter keeps of draws n of the noise, so that neither a truth nor the level of the
noise is needed. Where struts are no elastic beams (hinges, contacts, struts that were not seen) the
misfit is more than noise. By Stein's estimate
[Stein1981] the filtered displacement is nearer the truth than the measured one where

    |u - u_w|^2 - s^2 E|n|^2 + 2 s^2 E n . S n < s^2 E|n|^2,

s: the noise over that of its draws. More noise lets more misfit pass, and a weight counts if this holds
for s = 2: the filter is refused only where it would do harm even if the noise were twice its draws.
The truth of the twin is a network of beams too, which flatters the filter; hinging struts are the test
against it.
"""

import logging
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from addvc.correlation.frame_fit import (
    ITERATIONS,
    RELAXED,
    Problem,
    Solve,
    filtered,
    fitted,
    mean_square,
    solver_or_none,
)
from addvc.fem.frame import FrameMotion

log = logging.getLogger(__name__)

WEIGHTS = 10.0 ** np.arange(1, 6.1, 0.5)
"""Over the ratio of the medians of the diagonals of both terms; each is tried from the motion that
the one before has led to."""

DOUBTED = 2.0
"""By how much the noise may exceed its draws, which know of no robust weights and no lost struts; the
more, the more misfit is put down to it."""


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


def judged(problem: Problem, motion: FrameMotion, weight: float, draws: np.ndarray) -> Fit | None:
    """The fit with what the filter does to draws (d, k, 3) of the noise, not all of them zero; None
    where the matrix is not positive definite."""
    step = problem.step(motion, weight)
    solve, slopes = solver_or_none(step.matrix), step.slopes
    if solve is None:
        return None
    left, noise = filtered(solve, slopes, draws), mean_square(draws)
    misfit, kept = mean_square(problem.error(motion)), mean_square(left) / noise
    cut = 1 - float(np.sum(left * draws) / np.sum(np.square(draws, dtype=float)))
    bound, taken = 2 * DOUBTED**2 * cut * noise, mean_square(draws - left)
    return Fit(weight, motion, misfit, bound, taken, kept, misfit / cut**2, solve, slopes)


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
