"""A real image carried by a known motion of the solid in it: the inverse map, voxel by voxel.

A voxel y of the deformed image that lies in a deformed element, or within a margin of one, comes
from the point x of that element; v(y) = y - x. In the void between, v is the harmonic function
with these values (zero slope at the border of the image), found from coarse to fine: continuous,
without extremes of its own, and close to the motion of what is near. The motion of the void is
not part of the truth; it only keeps the image whole.
"""

import numpy as np
from scipy import ndimage

from addvc.fem.elements import tet_p2
from addvc.images.spline import interpolating_coefficients
from solid_twin.raster import locate_grid
from solid_twin.solid import Tetrahedra

MARGIN = 0.3
"""Least barycentric coordinate, below zero, at which a voxel outside moves like an element."""

SWEEPS = 30


def pulled_back(
    mesh: Tetrahedra, x: np.ndarray, shape: tuple[int, int, int]
) -> tuple[np.ndarray, np.ndarray, float]:
    """v (3, nx, ny, nz) float32 at the voxels of the deformed image, where it is known (nx, ny,
    nz) bool, and the share of the solid that is there twice. x (n, 3): deformed positions."""
    owner, local, twice = locate_grid(mesh, x, shape, margin=MARGIN, with_local=True)
    known = owner >= 0
    v = np.zeros((3, *shape), np.float32)
    moved = x - mesh.points
    n = tet_p2(local[:, known].T.astype(float))[0]
    v[:, known] = np.einsum("qa,qai->iq", n, moved[mesh.cells[owner[known]]])
    return v, known, twice / max(int(known.sum()), 1)


def harmonic(values: np.ndarray, known: np.ndarray) -> np.ndarray:
    """The values (nx, ny, nz) float32 where they are known (nx, ny, nz) bool, and a harmonic function
    elsewhere: the same on a grid twice as coarse, then Jacobi's sweeps."""
    if known.all() or not known.any():
        return values
    if max(known.shape) <= 2:
        return np.where(known, values, values[known].mean())
    pad = [(0, n % 2) for n in known.shape]
    weight = _blocks(np.pad(known, pad).astype(np.float32))
    mean = _blocks(np.pad(np.where(known, values, 0), pad)) / np.maximum(weight, 1e-9)
    start = harmonic(mean, weight > 0)
    for axis in range(3):
        start = start.repeat(2, axis)
    out = np.where(known, values, start[tuple(slice(0, n) for n in known.shape)])
    cross = ndimage.generate_binary_structure(3, 1).astype(np.float32)
    cross[1, 1, 1] = 0
    cross /= 6
    for _ in range(SWEEPS):
        out = np.where(known, values, ndimage.convolve(out, cross, mode="nearest"))
    return out


def _blocks(volume: np.ndarray) -> np.ndarray:
    """Means of blocks of 2 x 2 x 2 voxels."""
    a, b, c = (n // 2 for n in volume.shape)
    return volume.reshape(a, 2, b, 2, c, 2).mean(axis=(1, 3, 5), dtype=np.float32)


def warp(
    volume: np.ndarray, mesh: Tetrahedra, x: np.ndarray, noise: float, seed: int
) -> tuple[np.ndarray, float]:
    """The deformed image in the type of `volume` (nx, ny, nz), and the share of the solid that is
    there twice. The reference is interpolated by cubic splines, beyond its border the nearest
    voxel is taken; fresh Gaussian noise of deviation `noise` is added."""
    v, known, twice = pulled_back(mesh, x, volume.shape)
    source = np.stack([harmonic(component, known) for component in v])
    for axis, n in enumerate(volume.shape):
        line = np.arange(n, dtype=np.float32).reshape([-1 if d == axis else 1 for d in range(3)])
        source[axis] = np.clip(line - source[axis], 0, n - 1)
    grey = ndimage.map_coordinates(
        interpolating_coefficients(volume, 3), source, np.float32, 3, mode="mirror", prefilter=False
    )
    grey += noise * np.random.default_rng([seed, 1]).standard_normal(grey.shape, np.float32)
    if volume.dtype.kind in "iu":
        limits = np.iinfo(volume.dtype)
        grey = np.clip(np.rint(grey), limits.min, limits.max)
    return grey.astype(volume.dtype), twice
