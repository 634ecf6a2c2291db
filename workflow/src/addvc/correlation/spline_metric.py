"""Eq. 2, 3, 5 on a spline grid: which voxels take part, residual, gradient and Hessian of S(u).

Only voxels where the reference has a clear gradient take part (`correlation.clear`). The slope is the
mean of the gradients of I_r at X and of I_d at X + u, which predicts a motion one order better than
either.
"""

from dataclasses import dataclass

import numpy as np

from addvc.correlation.clear import clear_points
from addvc.correlation.metric import residual_statistics
from addvc.correlation.spline_grid import (
    SplineGrid,
    SplinePoints,
    scatter_vectors,
    spline_points,
    sum_basis,
)
from addvc.correlation.spline_stencil import scatter_dyads
from addvc.images.spline import DEGREE, spline_value_gradient


@dataclass(frozen=True, eq=False)
class Sampling:
    """I_r at the points of a grid: where they are on the grid, grey level, gradient, weight; degree
    of the splines of both images."""

    grid: SplineGrid
    points: SplinePoints
    grey: np.ndarray
    gradient: np.ndarray
    weight: np.ndarray
    degree: int = DEGREE

    def displacement(self, coefficients: np.ndarray) -> np.ndarray:
        """u (Q, 3) at the points."""
        return sum_basis(coefficients, self.points.cell, self.points.basis)


def sample(
    grid: SplineGrid, coefficients: np.ndarray, stride: int, clear: float, degree: int = DEGREE
) -> Sampling:
    """The clear points of I_r, given by its spline coefficients (nx, ny, nz), on a grid."""
    points = spline_points(grid, clear_points(coefficients, stride, clear, degree))
    grey, gradient, _ = spline_value_gradient(coefficients, points.points, degree)
    weight = np.full(len(grey), float(stride**3))
    return Sampling(grid, points, grey, gradient.astype(float), weight, degree)


def linearise(
    sampling: Sampling, deformed: np.ndarray, u: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Eq. 5 and its slope: r (Q,), the mean of both gradients (Q, 3), inside (Q,), at u (Q, 3).

    Points that have left I_d have neither."""
    at = sampling.points.points + u
    grey, gradient, inside = spline_value_gradient(deformed, at, sampling.degree)
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
