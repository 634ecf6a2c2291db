"""Where along the loading axis meso DVC leaves most of its residual: the paper's reason for the part of
its specimen that it takes to micro DVC."""

from collections.abc import Iterable

import numpy as np

from addvc.correlation.metric import reference_on, residual
from addvc.fem.mesh import Mesh
from addvc.fem.quadrature import voxel_points


def squared_residual(
    mesh: Mesh,
    coefficients: np.ndarray,
    states: Iterable[tuple[np.ndarray, np.ndarray]],
    gamma: float,
    axis: int,
    degree: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Sum of r^2 (grey levels^2) and number of points in each plane of voxels across the axis, (n,)
    both, over the voxels of I_r above gamma within the mesh, in all states together.

    I_r by its spline coefficients (nx, ny, nz), each state by its own and its u (k, 3) on the mesh."""
    points = voxel_points(mesh, coefficients.shape, 1, coefficients > gamma)
    reference = reference_on(mesh, points, coefficients, degree)
    plane = np.rint(points.points[:, axis]).astype(int)
    square, count = np.zeros(coefficients.shape[axis]), np.zeros(coefficients.shape[axis])
    for deformed, u in states:
        r, inside = residual(reference, deformed, u)
        square += np.bincount(plane[inside], r[inside].astype(float) ** 2, len(square))
        count += np.bincount(plane[inside], minlength=len(square))
    return square, count
