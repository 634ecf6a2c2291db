"""Eq. 2, 3, 5 on a spline grid: which voxels take part, residual, gradient and Hessian of S(u).

Only voxels where the reference has a clear gradient take part: at large strain the void beside a
strut meets other struts, and pulls the wrong way. The slope is the mean of the gradients of I_r at X
and of I_d at X + u, which predicts a motion one order better than either.
"""

from dataclasses import dataclass

import numpy as np

from addvc.correlation.metric import residual_statistics
from addvc.correlation.spline_grid import (
    SplineGrid,
    SplinePoints,
    scatter_vectors,
    spline_points,
    sum_basis,
)
from addvc.correlation.spline_stencil import scatter_dyads
from addvc.errors import CorrelationError
from addvc.images.spline import spline_value_gradient

MAXWELL_MEDIAN = 1.538  # median length of a vector of three normal deviates of variance one
STRONG = 99  # percentile of the gradients that stands for those of the structure
CLEARLY = 0.25  # of that is enough, however noisy
BLANK = 1e-5  # of the grey level: less is round-off


@dataclass(frozen=True, eq=False)
class Sampling:
    """I_r at the points of a grid: where they are on the grid, grey level, gradient, weight."""

    grid: SplineGrid
    points: SplinePoints
    grey: np.ndarray
    gradient: np.ndarray
    weight: np.ndarray

    def displacement(self, coefficients: np.ndarray) -> np.ndarray:
        """u (Q, 3) at the points."""
        return sum_basis(coefficients, self.points.cell, self.points.basis)


def sample(grid: SplineGrid, coefficients: np.ndarray, stride: int, clear: float) -> Sampling:
    """The clear points of I_r, given by its spline coefficients (nx, ny, nz), on a grid."""
    points = spline_points(grid, clear_points(coefficients, stride, clear))
    grey, gradient, _ = spline_value_gradient(coefficients, points.points)
    weight = np.full(len(grey), float(stride**3))
    return Sampling(grid, points, grey, gradient.astype(float), weight)


def clear_points(coefficients: np.ndarray, stride: int, clear: float) -> np.ndarray:
    """Every stride-th voxel centre whose gradient exceeds `clear` times the noise (Q, 3).

    The noise is that of the median voxel, which lies in the void. A quarter of the strong gradients
    is enough: in a texture, which has no void, most voxels take part."""
    lines = [np.arange(stride // 2, n, stride, dtype=float) for n in coefficients.shape]
    plane = np.stack(np.meshgrid(*lines[1:], indexing="ij"), axis=-1).reshape(-1, 2)
    length = np.empty((len(lines[0]), len(plane)), np.float32)
    for i, x in enumerate(lines[0]):  # plane by plane: all points at once would take gigabytes
        points = np.column_stack([np.full(len(plane), x), plane])
        length[i] = np.linalg.norm(spline_value_gradient(coefficients, points)[1], axis=1)
    noise, strong = np.median(length) / MAXWELL_MEDIAN, np.percentile(length, STRONG)
    if strong <= BLANK * np.abs(coefficients).max():
        raise CorrelationError(
            f"the gradient of the reference is at most {strong:.1e} grey level a voxel at {STRONG} % "
            "of its voxels: it is blank; check the scan, or leave freeform out of meso.candidates"
        )
    i, j = np.nonzero(length > min(clear * noise, CLEARLY * strong))
    return np.column_stack([lines[0][i], plane[j]])


def linearise(
    sampling: Sampling, deformed: np.ndarray, u: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Eq. 5 and its slope: r (Q,), the mean of both gradients (Q, 3), inside (Q,), at u (Q, 3).

    Points that have left I_d have neither."""
    grey, gradient, inside = spline_value_gradient(deformed, sampling.points.points + u)
    r = np.where(inside, sampling.grey - grey, 0.0).astype(float)
    mean = (sampling.gradient + gradient) / 2
    return r, np.where(inside[:, None], mean, 0.0), inside


def hessian(sampling: Sampling, slope: np.ndarray) -> np.ndarray:
    """H of Eq. 3 between control points, as a stencil."""
    points = sampling.points
    return scatter_dyads(sampling.grid.cells, points.first, points.basis, slope, sampling.weight)


def right_hand_side(sampling: Sampling, r: np.ndarray, slope: np.ndarray) -> np.ndarray:
    """b of Eq. 3 (nx, ny, nz, 3)."""
    points, vectors = sampling.points, (sampling.weight * r)[:, None] * slope
    return scatter_vectors(sampling.grid.cells, points.first, points.basis, vectors)


def statistics(sampling: Sampling, deformed: np.ndarray, u: np.ndarray) -> dict:
    """Mean and standard deviation of r at u (Q, 3), and the points that have left I_d."""
    r, _, inside = linearise(sampling, deformed, u)
    return residual_statistics(r, inside, sampling.weight)
