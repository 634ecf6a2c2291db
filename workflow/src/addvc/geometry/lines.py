"""Lines of the skeleton as dense points, and what of a mesh is nearest to which of them."""

import numpy as np
from scipy.spatial import cKDTree

SPACING = 0.25
"""Of the points of a branch that nodes are given to, voxels."""


def resampled(points: np.ndarray, spacing: float = SPACING) -> np.ndarray:
    """A line (k, 3) of voxels, smoothed over its neighbours, as points of about equal spacing."""
    smooth = points.copy()
    smooth[1:-1] = (points[:-2] + 2 * points[1:-1] + points[2:]) / 4
    s = np.r_[0, np.cumsum(np.linalg.norm(np.diff(smooth, axis=0), axis=1))]
    at = np.linspace(0, s[-1], max(2, round(s[-1] / spacing) + 1))
    return np.stack([np.interp(at, s, x) for x in smooth.T], axis=1)


def nearest_line(lines: list[np.ndarray], points: np.ndarray) -> list[np.ndarray]:
    """For each line (k, 3), which of the points (q, 3) are nearest to it."""
    owner = np.repeat(np.arange(len(lines)), [len(line) for line in lines])
    label = owner[cKDTree(np.vstack(lines)).query(points)[1]]
    order = np.argsort(label, kind="stable")
    return np.split(order, np.searchsorted(label[order], np.arange(1, len(lines))))
