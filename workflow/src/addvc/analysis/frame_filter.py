"""The measured displacement less what no frame of struts in equilibrium can do.

Noise moves the struts of a foam by less than a tenth of a voxel, which strains them along their axis
more than bending does. But struts carry no load between their ends, and those that meet balance each
other: only so much of the noise as a frame of elastic beams could follow is left when the motion q of
the frame minimises

    sum_k |u_k - u(q)|^2 + w |D f(q)|^2

over the nodes k of the mesh, f being the loads that nodes of the frame would need (forces times a
length, moments), D: not where the frame is cut. The weight w is chosen without any truth: by
Stein's estimate of the squared error [Stein1981],

    |u - u_w|^2 - E|n|^2 + 2 E n . S n,

with S n what the filter keeps of the draws n of the noise. What is assumed: struts are slender,
elastic, and of one stiffness, loads come through the cuts only. Where that is wrong (hinges, contacts,
lost struts) the misfit grows with w, and less weight is chosen: the filter then does little.
"""

import logging
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from addvc.analysis.strut_frame import StrutFrame
from addvc.fem.frame import Frame, FrameMotion, forces, skew

log = logging.getLogger(__name__)

WEIGHTS = 10.0 ** np.arange(1, 6.1, 0.5)
"""Tried in this order: each starts from the motion of the one before. Over the ratio of the traces of
both terms."""

HELD, RELAXED = 1e-6, 1e-2
"""Weight of the elastic energy, likewise: of nodes that nothing else holds, and where they start."""

REACH = 3.5
"""Farthest node of the mesh that moves with the frame, voxels from its axis."""

NEAR, WINDOW = 60, 2.5
"""Nodes of the mesh, and the width of their window in voxels, that the first motion is found from."""

ITERATIONS, SETTLED = 8, 5e-3
"""Of Gauss-Newton for each weight, and the rms of its last step, voxels and radians."""

LONGEST = 20
"""Step of a node, voxels or radians."""


@dataclass(frozen=True, eq=False)
class Attached:
    """Points (k,) that are carried by pieces (k,) of a frame, at shares (k, 1) between their ends,
    with arms (k, 3) from the axis; `distance` (k,) from it."""

    ends: np.ndarray
    share: np.ndarray
    arm: np.ndarray
    distance: np.ndarray

    @classmethod
    def of(cls, frame: Frame, points: np.ndarray) -> "Attached":
        """Each of the points (k, 3) to the nearest piece."""
        start, chord = frame.points[frame.pieces[:, 0]], frame.chord
        few = min(6, len(chord))
        near = cKDTree(start + chord / 2).query(points, k=few)[1].reshape(len(points), few)
        along = np.einsum("kpi,kpi->kp", points[:, None] - start[near], chord[near])
        share = np.clip(along / frame.length[near] ** 2, 0, 1)
        arm = points[:, None] - start[near] - share[..., None] * chord[near]
        distance = np.linalg.norm(arm, axis=2)
        rows, best = np.arange(len(points)), distance.argmin(axis=1)
        return cls(
            frame.pieces[near[rows, best]], share[rows, best, None], arm[rows, best],
            distance[rows, best],
        )  # fmt: skip

    def turned(self, motion: FrameMotion) -> np.ndarray:
        """Arms (2, k, 3), turned with either end."""
        return np.stack([
            np.einsum("kij,kj->ki", motion.rotations[end], self.arm) for end in self.ends.T
        ])  # fmt: skip

    def moved(self, motion: FrameMotion) -> np.ndarray:
        """Where the points are now, (k, 3)."""
        first, second = motion.positions[self.ends.T] + self.turned(motion)
        return first + self.share * (second - first)

    def slopes(self, motion: FrameMotion) -> sparse.csr_matrix:
        """What a step of the frame moves the points by, (3 k, 6 n)."""
        count, size = len(self.arm), 6 * len(motion.positions)
        weights = np.stack([1 - self.share, self.share])[..., None]
        eye = np.broadcast_to(np.eye(3), (2, count, 3, 3))
        blocks = weights * np.concatenate([eye, -skew(self.turned(motion))], axis=-1)
        columns = 6 * self.ends.T[..., None] + np.arange(6)
        rows = np.broadcast_to(3 * np.arange(count)[:, None] + np.arange(3), (2, count, 3))
        index = (
            np.repeat(rows.ravel(), 6), np.repeat(columns[:, :, None], 3, axis=2).ravel()
        )  # fmt: skip
        return sparse.csr_matrix((blocks.ravel(), index), shape=(3 * count, size))


def first_motion(frame: Frame, points: np.ndarray, u: np.ndarray) -> FrameMotion:
    """Each node as the points (k, 3) around it, displaced by u (k, 3), move on the whole."""
    few = min(NEAR, len(points))
    distance, near = cKDTree(points).query(frame.points, k=few)
    weight = np.exp(-0.5 * (distance / WINDOW) ** 2) + 1e-6
    positions, rotations = np.empty_like(frame.points), np.empty((len(frame.points), 3, 3))
    for n, (own, w) in enumerate(zip(near, weight, strict=True)):
        before, now = points[own], points[own] + u[own]
        middle, after = w @ before / w.sum(), w @ now / w.sum()
        turn, _ = Rotation.align_vectors(now - after, before - middle, weights=w)
        rotations[n] = turn.as_matrix()
        positions[n] = after + turn.apply(frame.points[n] - middle)
    return FrameMotion(positions, rotations)


@dataclass(frozen=True, eq=False)
class Problem:
    """A frame with points (k, 3) attached to it that are displaced by u (k, 3); nu: Poisson's ratio."""

    held: StrutFrame
    attached: Attached
    now: np.ndarray
    nu: float

    @property
    def gap(self) -> sparse.dia_matrix:
        """D (6 n, 6 n): forces times half the length of a strut, moments; none where loaded."""
        free = ~self.held.loaded[:, None]
        return sparse.diags((free * ([self.held.span / 2] * 3 + [1.0] * 3)).ravel())

    def system(self, motion: FrameMotion, weight: float, held: float = HELD):
        """The matrix of Gauss-Newton (6 n, 6 n), its right-hand side (6 n,), the slopes (3 k, 6 n)."""
        slopes = self.attached.slopes(motion)
        load, stiff = forces(self.held.frame, motion, self.nu)
        gap = self.gap @ stiff
        data, balance = (slopes.T @ slopes).tocsc(), (gap.T @ gap).tocsc()
        w, mu = (
            np.median(data.diagonal()) / np.median(matrix.diagonal()) for matrix in (balance, stiff)
        )
        w, mu = weight * w, held * mu
        error = (self.now - self.attached.moved(motion)).ravel()
        right = slopes.T @ error - w * (gap.T @ (self.gap @ load)) - mu * load
        return data + w * balance + mu * stiff, right, slopes


@dataclass(frozen=True, eq=False)
class Fit:
    """The motion of the frame with a weight, what the filter keeps of draws (d, k, 3) of the noise, the
    mean squares of the misfit, of the noise and of what is kept, and the estimate of the squared
    error, voxel^2."""

    weight: float
    motion: FrameMotion
    misfit: float
    noise: float
    kept: float
    error: float


def solver(matrix: sparse.csc_matrix):
    """x (N,) of matrix (N, N) x = b, for any b. Equations of balance squared are all but singular, so
    that pivots are not looked at as `fem.solver` does: Gauss-Newton mends what is lost."""
    from sksparse.cholmod import cholesky

    return cholesky(matrix.tocsc(), ordering_method="metis").solve_A


def fitted(problem: Problem, motion: FrameMotion, weight: float, held: float = HELD):
    """The motion that is best with this weight, from another one; None where none is found."""
    for _ in range(ITERATIONS):
        matrix, right, slopes = problem.system(motion, weight, held)
        step = solver(matrix)(right).reshape(-1, 6)
        size = np.sqrt(mean_square((slopes @ step.ravel()).reshape(-1, 3)));print('    ',weight,size,np.abs(step).max(),flush=True)
        longest = np.abs(step).max(axis=1, keepdims=True)
        motion = motion.moved(step * np.minimum(1, LONGEST / np.maximum(longest, LONGEST)))
        if size < SETTLED:
            return motion
    return None


def filtered(problem: Problem, motion: FrameMotion, weight: float, draws: np.ndarray):
    """Steps (d, n, 6) of the frame that draws (d, k, 3) of noise at the points make."""
    matrix, _, slopes = problem.system(motion, weight)
    solve = solver(matrix)
    return np.stack([solve(slopes.T @ n.ravel()).reshape(-1, 6) for n in draws])


def estimated(problem: Problem, motion: FrameMotion, weight: float, draws: np.ndarray) -> Fit:
    """The fit with its estimate of the squared error."""
    slopes = problem.attached.slopes(motion)
    steps = filtered(problem, motion, weight, draws)
    after = np.stack([(slopes @ step.ravel()).reshape(-1, 3) for step in steps])
    misfit = mean_square(problem.now - problem.attached.moved(motion))
    noise = mean_square(draws)
    shared = float(np.mean(np.sum(after * draws, axis=-1)))
    return Fit(weight, motion, misfit, noise, mean_square(after), misfit - noise + 2 * shared)


def mean_square(x: np.ndarray) -> float:
    """Of the lengths of vectors (..., 3)."""
    return float(np.mean(np.sum(np.square(x, dtype=float), axis=-1)))


def best_fit(
    problem: Problem, motion: FrameMotion, draws: np.ndarray
) -> Fit | None:
    """Over all weights, from the smallest on, the fit with the least estimate of the error; None where
    none settled."""
    best, motion = None, fitted(problem, motion, 0.0, RELAXED) or motion
    for weight in WEIGHTS:
        found = fitted(problem, motion, weight)
        if found is None:
            log.info("equilibrium of the frame: weight %.3g did not settle", weight)
            continue
        motion = found
        fit = estimated(problem, motion, weight, draws)
        log.info("weight %.3g: misfit %.4f, error estimated %.4f voxel", weight,
                 np.sqrt(fit.misfit), np.sqrt(max(fit.error, 0)))  # fmt: skip
        if best is None or fit.error < best.error:
            best = fit
    return best
