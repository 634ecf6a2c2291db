"""Eq. 4: a volume as a cubic B-spline, its value and its gradient at any point.

The voxels are the coefficients themselves (no prefilter), as in the paper: the representation
smooths a little instead of interpolating, which keeps gradients regular. `interpolating_coefficients`
gives those of the spline through the voxels. Beyond the outermost voxels the edge voxel is
repeated; points beyond the outermost voxel centres are "outside".
"""

import numba as nb
import numpy as np
from scipy import ndimage


def interpolating_coefficients(volume: np.ndarray) -> np.ndarray:
    """Coefficients of the cubic B-spline through every inner voxel of `volume` (nx, ny, nz), float32."""
    return ndimage.spline_filter(volume, order=3, output=np.float32, mode="mirror")


def gaussian_blur(volume: np.ndarray, sigma: float) -> np.ndarray:
    """Eq. 8: c = G_sigma * I, (nx, ny, nz) float32; sigma in voxels, 0 for none."""
    if sigma == 0:
        return np.ascontiguousarray(volume, dtype=np.float32)
    return ndimage.gaussian_filter(volume, sigma, output=np.float32, mode="nearest", truncate=4.0)


def gradient_length(coefficients: np.ndarray) -> np.ndarray:
    """Length of the gradient of the spline at all voxel centres (nx, ny, nz), float32, grey levels a
    voxel: what `spline_value_gradient` gives there, axis by axis and so some ten times faster."""
    value, slope = np.array([1, 4, 1]) / 6, np.array([-0.5, 0, 0.5])
    square = np.zeros(coefficients.shape, np.float32)
    for axis in range(3):
        part = coefficients
        for along in range(3):
            weights = slope if along == axis else value
            part = ndimage.correlate1d(part, weights, along, np.float32, mode="nearest")
        square += np.square(part, out=part)
    return np.sqrt(square, out=square)


@nb.njit(inline="always")
def _weights(t):
    s = 1.0 - t
    return (
        s * s * s / 6.0,
        (3.0 * t * t * t - 6.0 * t * t + 4.0) / 6.0,
        (3.0 * s * s * s - 6.0 * s * s + 4.0) / 6.0,
        t * t * t / 6.0,
    )


@nb.njit(inline="always")
def _slopes(t):
    s = 1.0 - t
    return (
        -s * s / 2.0,
        (3.0 * t * t - 4.0 * t) / 2.0,
        (4.0 * s - 3.0 * s * s) / 2.0,
        t * t / 2.0,
    )


@nb.njit(inline="always")
def _clamp(i, n):
    return min(max(i, 0), n - 1)


@nb.njit(parallel=True, cache=True)
def spline_value(coefficients, points):
    """Value of the spline at points (n, 3) in voxels: values (n,) float32, inside (n,) bool."""
    nx, ny, nz = coefficients.shape
    n = points.shape[0]
    value = np.zeros(n, np.float32)
    inside = np.zeros(n, np.bool_)
    for p in nb.prange(n):
        x, y, z = points[p, 0], points[p, 1], points[p, 2]
        if not (0.0 <= x <= nx - 1 and 0.0 <= y <= ny - 1 and 0.0 <= z <= nz - 1):
            continue
        inside[p] = True
        i, j, k = int(np.floor(x)), int(np.floor(y)), int(np.floor(z))
        wx, wy, wz = _weights(x - i), _weights(y - j), _weights(z - k)
        total = 0.0
        for a in range(4):
            ia = _clamp(i - 1 + a, nx)
            for b in range(4):
                jb = _clamp(j - 1 + b, ny)
                line = 0.0
                for c in range(4):
                    line += wz[c] * coefficients[ia, jb, _clamp(k - 1 + c, nz)]
                total += wx[a] * wy[b] * line
        value[p] = total
    return value, inside


@nb.njit(parallel=True, cache=True)
def spline_value_gradient(coefficients, points):
    """Value (n,), gradient (n, 3) per voxel, both float32, and inside (n,) bool at points (n, 3)."""
    nx, ny, nz = coefficients.shape
    n = points.shape[0]
    value = np.zeros(n, np.float32)
    gradient = np.zeros((n, 3), np.float32)
    inside = np.zeros(n, np.bool_)
    for p in nb.prange(n):
        x, y, z = points[p, 0], points[p, 1], points[p, 2]
        if not (0.0 <= x <= nx - 1 and 0.0 <= y <= ny - 1 and 0.0 <= z <= nz - 1):
            continue
        inside[p] = True
        i, j, k = int(np.floor(x)), int(np.floor(y)), int(np.floor(z))
        wx, wy, wz = _weights(x - i), _weights(y - j), _weights(z - k)
        sx, sy, sz = _slopes(x - i), _slopes(y - j), _slopes(z - k)
        v, gx, gy, gz = 0.0, 0.0, 0.0, 0.0
        for a in range(4):
            ia = _clamp(i - 1 + a, nx)
            for b in range(4):
                jb = _clamp(j - 1 + b, ny)
                line, slope = 0.0, 0.0
                for c in range(4):
                    grey = coefficients[ia, jb, _clamp(k - 1 + c, nz)]
                    line += wz[c] * grey
                    slope += sz[c] * grey
                v += wx[a] * wy[b] * line
                gx += sx[a] * wy[b] * line
                gy += wx[a] * sy[b] * line
                gz += wx[a] * wy[b] * slope
        value[p] = v
        gradient[p, 0], gradient[p, 1], gradient[p, 2] = gx, gy, gz
    return value, gradient, inside
