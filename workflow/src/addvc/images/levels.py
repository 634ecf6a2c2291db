"""Levels of an image: block means, and the one place where positions change level.

A coarse voxel is the mean of `factor`^3 fine ones, so that its centre lies in the middle of theirs:
x_fine = factor x_coarse + (factor - 1) / 2.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from addvc.errors import ScanError


def to_fine(x: ArrayLike, factor: float) -> NDArray:
    """Positions on the coarse level (any shape, coarse voxels) -> fine voxels."""
    return factor * np.asarray(x, dtype=float) + (factor - 1) / 2


def to_coarse(x: ArrayLike, factor: float) -> NDArray:
    """Positions on the fine level (any shape, fine voxels) -> coarse voxels."""
    return (np.asarray(x, dtype=float) - (factor - 1) / 2) / factor


def displacement_to_fine(u: ArrayLike, factor: float) -> NDArray:
    """Displacements in coarse voxels (any shape) -> fine voxels: a difference has no shift."""
    return factor * np.asarray(u, dtype=float)


def displacement_to_coarse(u: ArrayLike, factor: float) -> NDArray:
    """Displacements in fine voxels (any shape) -> coarse voxels."""
    return np.asarray(u, dtype=float) / factor


def bin_mean(volume: NDArray, factor: int) -> NDArray[np.float32]:
    """Block means of a volume: (nx, ny, nz) -> (nx // factor, ny // factor, nz // factor), float32.

    A trailing remainder smaller than `factor` is cut off. One axis after the other, each as a sum
    of strided views, which keeps the memory order of `volume`. Raises ScanError when the factor
    is not a whole number of at least 1 or exceeds the size.
    """
    if factor != int(factor) or factor < 1:
        raise ScanError(f"binning factor is {factor}; use a whole number of at least 1")
    factor = int(factor)
    if min(volume.shape) < factor:
        raise ScanError(
            f"an image of {volume.shape} voxels cannot be binned by {factor}; "
            f"use a factor of at most {min(volume.shape)}"
        )
    mean = np.asarray(volume)
    for axis in np.argsort(mean.strides)[::-1]:  # long rows of memory are added first
        mean = _sum_along(mean, factor, axis)
    mean *= np.float32(1 / factor**mean.ndim)
    return mean


def _sum_along(volume: NDArray, factor: int, axis: int) -> NDArray[np.float32]:
    """Sums of `factor` neighbours along one axis, as a new float32 array."""
    stop = volume.shape[axis] // factor * factor
    index = [slice(None)] * volume.ndim
    index[axis] = slice(0, stop, factor)
    total = volume[tuple(index)].astype(np.float32)
    for first in range(1, factor):
        index[axis] = slice(first, stop, factor)
        total += volume[tuple(index)]
    return total


def pyramid(volume: NDArray, levels: int) -> list[NDArray[np.float32]]:
    """`levels` images of a volume (nx, ny, nz), the finest first; each next one is the previous one
    binned by 2.

    Raises ScanError for less than one level, or when an image to be binned is one voxel wide."""
    if levels < 1:
        raise ScanError(f"a pyramid of {levels} levels is empty; use at least 1")
    images = [np.asarray(volume, dtype=np.float32)]
    for _ in range(levels - 1):
        images.append(bin_mean(images[-1], 2))
    return images
