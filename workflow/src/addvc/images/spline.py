"""Eq. 4: a volume as a B-spline of degree p, its value and its gradient at any point.

The voxels are the coefficients themselves (no prefilter), as in the paper: the representation
smooths a little instead of interpolating, which keeps gradients regular. `interpolating_coefficients`
gives those of the spline through the voxels. Beyond the outermost voxels the edge voxel is
repeated; points beyond the outermost voxel centres are "outside".

The paper has p = 3. A spline of degree p lets sin(w / 2) / (w / 2) to the power p + 1 of what lies
beyond the frequencies of the voxels through, and that is what registers a shifted image wrongly: with
p = 5 the ultimate errors of the default twin are 1.2, .7, 1.7 and .5e-4 voxel (33, 23, 12, micro)
where p = 3 leaves 5.3, 3.4, 7.7 and 3.2e-4. It smooths by a variance of 1/2 in place of 1/3 voxel^2,
which costs 2 to 3 % in the error of registration; a blur of .7 in place of .8 voxel gives that back
(.0692, .0761, .1031 voxel of micro DVC at states 1 to 3, for .0690, .0760, .1081 with p = 3), at
ultimate errors of 2.1, 1.3, 2.9 and .8e-4 (with l_L of 0.6 of the edge; 2.1, 2.2, 5.6 and .6e-4 today).
"""

import numba as nb
import numpy as np
from scipy import ndimage

DEGREE = 5
"""p of Eq. 4: 3 or 5."""

WRONG_DEGREE = "the degree of the splines must be 3 or 5: set images.degree to one of these"


def interpolating_coefficients(volume: np.ndarray, degree: int = DEGREE) -> np.ndarray:
    """Coefficients (nx, ny, nz), float32, of the B-spline of this degree through every inner voxel of
    `volume` (nx, ny, nz)."""
    return ndimage.spline_filter(volume, order=degree, output=np.float32, mode="mirror")


def gaussian_blur(volume: np.ndarray, sigma: float) -> np.ndarray:
    """Eq. 8: c = G_sigma * I, (nx, ny, nz) float32; sigma in voxels, 0 for none."""
    if sigma == 0:
        return np.ascontiguousarray(volume, dtype=np.float32)
    return ndimage.gaussian_filter(volume, sigma, output=np.float32, mode="nearest", truncate=4.0)


def gradient_length(coefficients: np.ndarray, degree: int = DEGREE) -> np.ndarray:
    """Length of the gradient of the spline at all voxel centres (nx, ny, nz), float32, grey levels a
    voxel: what `spline_value_gradient` gives there, axis by axis and so some ten times faster."""
    value, slope = np.array(_weights(0.0, degree)[:-1]), np.array(_slopes(0.0, degree)[:-1])
    square = np.zeros(coefficients.shape, np.float32)
    for axis in range(3):
        part = coefficients
        for along in range(3):
            weights = slope if along == axis else value
            part = ndimage.correlate1d(part, weights, along, np.float32, mode="nearest")
        square += np.square(part, out=part)
    return np.sqrt(square, out=square)


@nb.njit(inline="always")
def _weights(t, degree):
    """Of the voxels floor(x) - 2 to floor(x) + 3, t = x - floor(x); for degree 3 the outer two have
    none."""
    s = 1.0 - t
    if degree == 3:
        return (
            0.0,
            s * s * s / 6.0,
            (4.0 + t * t * (3.0 * t - 6.0)) / 6.0,
            (4.0 + s * s * (3.0 * s - 6.0)) / 6.0,
            t * t * t / 6.0,
            0.0,
        )
    return (
        s * s * s * s * s / 120.0,
        (26.0 + t * (-50.0 + t * (20.0 + t * (20.0 + t * (-20.0 + 5.0 * t))))) / 120.0,
        (66.0 + t * t * (-60.0 + t * t * (30.0 - 10.0 * t))) / 120.0,
        (66.0 + s * s * (-60.0 + s * s * (30.0 - 10.0 * s))) / 120.0,
        (26.0 + s * (-50.0 + s * (20.0 + s * (20.0 + s * (-20.0 + 5.0 * s))))) / 120.0,
        t * t * t * t * t / 120.0,
    )


@nb.njit(inline="always")
def _slopes(t, degree):
    """The derivatives of `_weights` by x."""
    s = 1.0 - t
    if degree == 3:
        return (
            0.0,
            -s * s / 2.0,
            t * (3.0 * t - 4.0) / 2.0,
            s * (4.0 - 3.0 * s) / 2.0,
            t * t / 2.0,
            0.0,
        )
    return (
        -s * s * s * s / 24.0,
        (-10.0 + t * (8.0 + t * (12.0 + t * (-16.0 + 5.0 * t)))) / 24.0,
        t * (-12.0 + t * t * (12.0 - 5.0 * t)) / 12.0,
        s * (12.0 + s * s * (5.0 * s - 12.0)) / 12.0,
        (10.0 - s * (8.0 + s * (12.0 + s * (-16.0 + 5.0 * s)))) / 24.0,
        t * t * t * t / 24.0,
    )


@nb.njit(inline="always")
def _clamp(i, n):
    """Unsigned, since a signed index is looked at for being negative: half of a gradient's time."""
    return np.uint64(min(max(i, 0), n - 1))


@nb.njit(inline="always")
def _places(i, n):
    """The voxels of `_weights` along an axis of n voxels."""
    return (
        _clamp(i - 2, n),
        _clamp(i - 1, n),
        _clamp(i, n),
        _clamp(i + 1, n),
        _clamp(i + 2, n),
        _clamp(i + 3, n),
    )


@nb.njit(inline="always")
def _sum(coefficients, i, j, at, w):
    return (
        w[0] * coefficients[i, j, at[0]]
        + w[1] * coefficients[i, j, at[1]]
        + w[2] * coefficients[i, j, at[2]]
        + w[3] * coefficients[i, j, at[3]]
        + w[4] * coefficients[i, j, at[4]]
        + w[5] * coefficients[i, j, at[5]]
    )


@nb.njit(parallel=True, cache=True, fastmath={"contract"})
def spline_value(coefficients, points, degree=DEGREE):
    """Value of the spline at points (n, 3) in voxels: values (n,) float32, inside (n,) bool.

    Raises ValueError for any degree but 3 and 5."""
    if degree != 3 and degree != 5:
        raise ValueError(WRONG_DEGREE)
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
        wx, wy = _weights(x - i, degree), _weights(y - j, degree)
        wz, at = _weights(z - k, degree), _places(k, nz)
        total = 0.0
        for a in range(6):
            along_y, at_x = 0.0, _clamp(i - 2 + a, nx)
            for b in range(6):
                along_y += wy[b] * _sum(coefficients, at_x, _clamp(j - 2 + b, ny), at, wz)
            total += wx[a] * along_y
        value[p] = total
    return value, inside


@nb.njit(parallel=True, cache=True, fastmath={"contract"})
def spline_value_gradient(coefficients, points, degree=DEGREE):
    """Value (n,), gradient (n, 3) per voxel, both float32, and inside (n,) bool at points (n, 3).

    Raises ValueError for any degree but 3 and 5."""
    if degree != 3 and degree != 5:
        raise ValueError(WRONG_DEGREE)
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
        wx, wy = _weights(x - i, degree), _weights(y - j, degree)
        wz, at = _weights(z - k, degree), _places(k, nz)
        sx, sy = _slopes(x - i, degree), _slopes(y - j, degree)
        sz = _slopes(z - k, degree)
        total, slope_x, slope_y, slope_z = 0.0, 0.0, 0.0, 0.0
        for a in range(6):
            along_y, turned_y, turned_z = 0.0, 0.0, 0.0
            at_x = _clamp(i - 2 + a, nx)
            for b in range(6):
                at_y = _clamp(j - 2 + b, ny)
                line = _sum(coefficients, at_x, at_y, at, wz)
                along_y += wy[b] * line
                turned_y += sy[b] * line
                turned_z += wy[b] * _sum(coefficients, at_x, at_y, at, sz)
            total += wx[a] * along_y
            slope_x += sx[a] * along_y
            slope_y += wx[a] * turned_y
            slope_z += wx[a] * turned_z
        value[p] = total
        gradient[p, 0], gradient[p, 1], gradient[p, 2] = slope_x, slope_y, slope_z
    return value, gradient, inside
