"""The outline of the specimen across its axis, from counts of solid voxels along the axis.

Solid inside a shape has one density and specks of noise outside it another, so that the best shape
is that of the largest Poisson likelihood (the spatial scan statistic): it needs neither a cleaned
segmentation nor a continuous skin, of which a foam has none.
"""

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.special import xlogy

Disc = tuple[tuple[float, float], float]
Rectangle = tuple[tuple[float, float], tuple[float, float]]

FILLED_CORNERS = 0.5  # of the density inside the inscribed ellipse
OUTSIDE = 0.3  # of the density inside: above it, what is beyond the edge is specimen too
RADIUS_STEP = 0.125  # voxels
NEAR_END = 1  # voxel: an edge this near to the end of the image is the end


def corners_filled(counts: NDArray) -> bool:
    """Whether the solid reaches into the corners, outside the inscribed ellipse of the image."""
    grid = np.ogrid[tuple(slice(n) for n in counts.shape)]
    squares = [((x - (n - 1) / 2) / (n / 2)) ** 2 for x, n in zip(grid, counts.shape, strict=True)]
    inside = squares[0] + squares[1] <= 1
    return bool(counts[~inside].mean() >= FILLED_CORNERS * counts[inside].mean())


def likelihood(counts: NDArray, rows: int, shape: Disc | Rectangle) -> float:
    """Log-likelihood of solid counts (n1, n2) along `rows` rows, given a disc or rectangle."""
    first, second = np.ogrid[tuple(slice(n) for n in counts.shape)]
    if np.ndim(shape[1]) == 0:
        (a, b), radius = shape
        inside = np.hypot(first - a, second - b) <= radius
    else:
        (a, b), (c, d) = shape
        inside = (first >= a) & (first <= b) & (second >= c) & (second <= d)
    total = counts.sum()
    return float(
        _two_densities(counts[inside].sum(), inside.sum() * rows, total, inside.size * rows)
    )


def _two_densities(solid: NDArray, voxels: NDArray, all_solid: float, all_voxels: float) -> NDArray:
    """Log-likelihood of `solid` of `voxels` inside and the rest outside; -inf if thinner inside."""
    outside, rest = all_solid - solid, all_voxels - voxels
    value = xlogy(solid, solid / np.maximum(voxels, 1)) + xlogy(
        outside, outside / np.maximum(rest, 1)
    )
    return np.where(solid * rest >= outside * voxels, value, -np.inf)


def fit_disc(counts: NDArray, rows: int) -> Disc:
    """Centre and radius of the disc that best holds the solid; counts (n1, n2).

    Where the corners are filled, there is no outside to tell it from: the inscribed disc.
    """
    n1, n2 = counts.shape
    if corners_filled(counts):
        return ((n1 - 1) / 2, (n2 - 1) / 2), min(n1, n2) / 2
    best = partial(_best_radius, counts, rows)
    centre = _climb(lambda at: best(at)[0], _centroid(counts))
    return (float(centre[0]), float(centre[1])), best(centre)[1]


def _centroid(counts: NDArray) -> NDArray:
    """Centroid (2,) of what stands out from the median, where a climb may start."""
    weights = np.maximum(counts - np.median(counts), 0) + 1e-9
    return np.array([(x * weights).sum() for x in np.indices(counts.shape)]) / weights.sum()


def _best_radius(counts: NDArray, rows: int, centre: NDArray) -> tuple[float, float]:
    """Likelihood and radius of the best disc about a centre (2,)."""
    first, second = np.ogrid[tuple(slice(n) for n in counts.shape)]
    ring = (np.hypot(first - centre[0], second - centre[1]) / RADIUS_STEP).astype(np.intp).ravel()
    solid = np.cumsum(np.bincount(ring, counts.ravel()))
    voxels = np.cumsum(np.bincount(ring)) * rows
    value = _two_densities(solid, voxels, solid[-1], voxels[-1])
    at = int(np.argmax(value))
    return float(value[at]), (at + 0.5) * RADIUS_STEP


def _climb(value: Callable[[NDArray], float], start: NDArray) -> NDArray:
    """Pattern search for the maximum of value(x) over x (2,), in steps of 8 to 1/16 voxel."""
    moves = np.array([(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j])
    x, top, step = start, value(start), 8.0
    while step >= 1 / 16:
        trials = x + step * moves
        values = [value(trial) for trial in trials]
        if max(values) > top:
            x, top = trials[int(np.argmax(values))], max(values)
        else:
            step /= 2
    return x


def fit_rectangle(counts: NDArray, rows: int) -> Rectangle:
    """Bounds of the rectangle, along the axes, that best holds the solid; counts (n1, n2).

    A side beyond which the density stays high lies at the end of the image, -0.5 or n - 0.5.
    """
    across = counts.shape[::-1]
    first, second = (
        _best_interval(counts.sum(axis=1 - side), rows * across[side]) for side in (0, 1)
    )
    return first, second


def _best_interval(counts: NDArray, voxels: int) -> tuple[float, float]:
    """Faces of the interval that best holds the solid counts (n,), of `voxels` voxels each."""
    n = len(counts)
    sums = np.concatenate(([0.0], np.cumsum(counts)))
    start, stop = np.triu_indices(n + 1, 1)
    solid = sums[stop] - sums[start]
    value = _two_densities(solid, (stop - start) * voxels, sums[-1], n * voxels)
    at = int(np.argmax(value))
    start, stop, limit = int(start[at]), int(stop[at]), OUTSIDE * solid[at] / (stop - start)[at]
    if start <= NEAR_END or sums[start] / start > limit:
        start = 0
    if n - stop <= NEAR_END or (sums[-1] - sums[stop]) / (n - stop) > limit:
        stop = n
    return start - 0.5, stop - 0.5
