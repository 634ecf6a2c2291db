"""Motions of a frame of struts that follow a displacement and need hardly any loads.

Noise of a tenth of a voxel stretches struts more than loads do where they bend. But struts carry no
load between their ends, and those that meet balance each other. So of all motions q of the frame
(`geometry.strut_frame`) that is sought which minimises

    sum_k rho(|u_k - u_k(q)|) + w |D f(q)|^2 + e E(q)

over points k that the frame carries; f: the loads that the nodes of the frame would need, forces times
half the median length of the struts, and moments; D leaves out where the frame is cut; E: the elastic
energy, with so small a weight e that it only holds what nothing else holds. rho(x) is x^2 or, where
struts may be in a wrong place, that of Geman and McClure, by which such struts count for nothing. Both
weights are over the ratio of the medians of the diagonals of their term and of the first. Assumed are
slender elastic struts of one stiffness, without contacts.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from addvc.correlation.gauss_newton import rms
from addvc.correlation.metric import geman_mcclure
from addvc.fem.carried import Attached
from addvc.fem.frame import FrameMotion, forces
from addvc.geometry.strut_frame import StrutFrame

HELD, RELAXED = 1e-5, 1e-2
"""Weight e of the elastic energy, and a larger one to start with."""

DAMPED = 1e-4
"""Weight of the squared steps [Levenberg1944], likewise: so a strut that carries no point is swung about
by little at a time."""

ITERATIONS, SETTLED = 8, 5e-3
"""Of Gauss-Newton for each weight, at most, and the rms of the last step of the points, voxels: a
twentieth of the noise."""

LONGEST = 2.0
"""Step of a node of the frame, voxels or radians."""

Solve = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False)
class Step:
    """The matrix of Gauss-Newton (6 n, 6 n), its right-hand side (6 n,), the slopes of the points (3 k,
    6 n), the trust in them (k,)."""

    matrix: sparse.csc_matrix
    right: np.ndarray
    slopes: sparse.csr_matrix
    trust: np.ndarray


@dataclass(frozen=True, eq=False)
class Problem:
    """A frame with points (k, 3) attached to it that are `now` (k, 3); nu: Poisson's ratio; `reach`: the
    scale of rho, voxels, None for plain squares."""

    held: StrutFrame
    attached: Attached
    now: np.ndarray
    nu: float
    reach: float | None = None

    def __post_init__(self) -> None:
        free = ~self.held.loaded[:, None]
        rows = (free * ([self.held.span / 2] * 3 + [1.0] * 3)).ravel()
        object.__setattr__(self, "gap", sparse.diags(rows))

    def error(self, motion: FrameMotion) -> np.ndarray:
        """(k, 3) voxels: how far the points are from where the frame carries them."""
        return self.now - self.attached.moved(motion)

    def trust(self, error: np.ndarray) -> np.ndarray:
        """Weights (k,) of points with errors (k, 3)."""
        if self.reach is None:
            return np.ones(len(error))
        return geman_mcclure(np.linalg.norm(error, axis=1), self.reach)

    def step(self, motion: FrameMotion, weight: float, elastic: float = HELD) -> Step:
        """What Gauss-Newton solves next, from a motion, with weights w and e."""
        slopes, error = self.attached.slopes(motion), self.error(motion)
        trust = self.trust(error)
        trusted = slopes.T @ sparse.diags(np.repeat(trust, 3))
        load, stiff = forces(self.held.frame, motion, self.nu)
        gap = self.gap @ stiff
        data, balance = (trusted @ slopes).tocsc(), (gap.T @ gap).tocsc()
        scale = middle(np.bincount(slopes.indices, slopes.data**2))
        w, mu = (
            weight * scale / middle(balance.diagonal()),
            elastic * scale / middle(stiff.diagonal()),
        )
        right = trusted @ error.ravel() - w * (gap.T @ (self.gap @ load)) - mu * load
        damping = DAMPED * scale * sparse.identity(len(right))
        matrix = (data + w * balance + mu * stiff + damping).tocsc()
        return Step(matrix, right, slopes, trust)


def middle(diagonal: np.ndarray) -> float:
    """Median of what is not zero."""
    return float(np.median(diagonal[diagonal > 0]))


def solver_or_none(matrix: sparse.csc_matrix) -> Solve | None:
    """x (N,) of matrix (N, N) x = b, for any b; None where it is not positive definite. It may be all
    but singular, as squared equations of balance are: Gauss-Newton mends what is lost by it."""
    from sksparse.cholmod import CholmodNotPositiveDefiniteError, cholesky

    try:
        return cholesky(matrix, ordering_method="metis").solve_A
    except CholmodNotPositiveDefiniteError:
        return None


@dataclass(frozen=True, eq=False)
class Approach:
    """A motion, the rms steps of the points that have led to it, voxels, and the last step's solver."""

    motion: FrameMotion
    steps: list[float]
    last: Step
    solve: Solve

    @property
    def settled(self) -> bool:
        return self.steps[-1] < SETTLED

    def kept(self, draws: np.ndarray) -> np.ndarray:
        """What the frame follows of draws (d, k, 3) of the noise of the points."""
        return filtered(self.solve, self.last.slopes, self.last.trust[:, None] * draws)


def approached(
    problem: Problem,
    motion: FrameMotion,
    weight: float,
    elastic: float = HELD,
    iterations: int = ITERATIONS,
) -> Approach | None:
    """Some iterations with these weights, from a motion; None where a matrix is not positive definite,
    or a step not finite."""
    steps = []
    for _ in range(iterations):
        last = problem.step(motion, weight, elastic)
        solve = solver_or_none(last.matrix)
        if solve is None:
            return None
        step = solve(last.right)
        steps.append(rms((last.slopes @ step).reshape(-1, 3)))
        if not np.isfinite(steps[-1]):
            return None
        step = step.reshape(-1, 6)
        longest = np.abs(step).max(axis=1, keepdims=True)
        motion = motion.moved(step * np.minimum(1, LONGEST / np.maximum(longest, LONGEST)))
        if steps[-1] < SETTLED:
            break
    return Approach(motion, steps, last, solve)


def fitted(
    problem: Problem, motion: FrameMotion, weight: float, elastic: float = HELD
) -> FrameMotion | None:
    """The motion that is best with these weights, from another one; None where none is found."""
    found = approached(problem, motion, weight, elastic)
    return found.motion if found and found.settled else None


def filtered(
    solve: Solve, slopes: sparse.csr_matrix, draws: np.ndarray, at: sparse.csr_matrix | None = None
) -> np.ndarray:
    """What of draws (d, k, 3) the frame follows, at the points of slopes (3 k, 6 n) or at others of
    slopes `at` (3 q, 6 n): (d, q, 3)."""
    at = slopes if at is None else at
    return np.stack([(at @ solve(slopes.T @ n.ravel())).reshape(-1, 3) for n in draws])


def mean_square(x: np.ndarray) -> float:
    """Of the lengths of vectors (..., 3)."""
    return float(np.mean(np.sum(np.square(x, dtype=float), axis=-1)))
