"""What a frame of struts carries: the nodes of a mesh, each with the piece that it is nearest to."""

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from addvc.fem.frame import Frame, FrameMotion, skew

FEW = 6
"""Pieces whose middles are nearest to a point: one of them is the nearest."""

NEAR, WINDOW, WINDOW_RADII = 60, 2.5, 1.5
"""Nodes of the mesh, and the width of their window in voxels, or in radii of the struts where these
are more, that the first motion is found from."""

BEYOND, REACH_RADII = 1.5, 1.6
"""How far from the axis of a strut its nodes may be: voxels that its line may be off, and radii of a
round section of its area, of which the corner of a triangle has 1.56."""

FAR = 1e-6
"""Weight of those beyond the window."""


@dataclass(frozen=True, eq=False)
class Attached:
    """Points (k,) that are carried by pieces (k,) of a frame, at shares (k, 1) between their ends,
    with arms (k, 3) from the axis; `distance` (k,) from it, `radius` (k,) of the pieces."""

    ends: np.ndarray
    share: np.ndarray
    arm: np.ndarray
    distance: np.ndarray
    radius: np.ndarray

    @property
    def within(self) -> np.ndarray:
        """Which points, bool (k,), are near enough to move with the frame."""
        return self.distance < BEYOND + REACH_RADII * self.radius

    def __getitem__(self, some: np.ndarray) -> "Attached":
        """Some of the points, bool (k,)."""
        parts = (self.ends, self.share, self.arm, self.distance, self.radius)
        return Attached(*(part[some] for part in parts))

    @classmethod
    def of(cls, frame: Frame, points: np.ndarray) -> "Attached":
        """Each of the points (k, 3) to the nearest piece."""
        start, chord = frame.points[frame.pieces[:, 0]], frame.chord
        few = min(FEW, len(chord))
        near = cKDTree(start + chord / 2).query(points, k=few)[1].reshape(len(points), few)
        along = np.einsum("kpi,kpi->kp", points[:, None] - start[near], chord[near])
        share = np.clip(along / frame.length[near] ** 2, 0, 1)
        arm = points[:, None] - start[near] - share[..., None] * chord[near]
        distance = np.linalg.norm(arm, axis=2)
        rows, best = np.arange(len(points)), distance.argmin(axis=1)
        piece = near[rows, best]
        return cls(
            frame.pieces[piece], share[rows, best, None], arm[rows, best], distance[rows, best],
            frame.radius[piece],
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
        columns = 6 * self.ends[..., None] + np.arange(6)
        entries = np.ascontiguousarray(blocks.transpose(1, 2, 0, 3))  # of a row: two ends, six dofs
        indices = np.broadcast_to(columns[:, None], entries.shape)
        starts = 12 * np.arange(3 * count + 1)
        return sparse.csr_matrix((entries.ravel(), indices.ravel(), starts), (3 * count, size))


def first_motion(frame: Frame, points: np.ndarray, u: np.ndarray) -> FrameMotion:
    """Each node as the points (k, 3) around it, displaced by u (k, 3), move on the whole."""
    few = min(NEAR, len(points))
    distance, near = cKDTree(points).query(frame.points, k=few)
    width = np.maximum(WINDOW, WINDOW_RADII * frame.radius_at_nodes)[:, None]
    weight = np.exp(-0.5 * (distance / width) ** 2) + FAR
    positions, rotations = np.empty_like(frame.points), np.empty((len(frame.points), 3, 3))
    for n, (own, w) in enumerate(zip(near, weight, strict=True)):
        before, now = points[own], points[own] + u[own]
        middle, after = w @ before / w.sum(), w @ now / w.sum()
        turn, _ = Rotation.align_vectors(now - after, before - middle, weights=w)
        rotations[n] = turn.as_matrix()
        positions[n] = after + turn.apply(frame.points[n] - middle)
    return FrameMotion(positions, rotations)
