"""Scans: files of many formats, read slab by slab, cropped and binned into float32 volumes.

A volume is I[i, j, k] with x = i, y = j, z = k at voxel centres, whatever the order in the file.
"""

import glob
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from addvc.config import TIFF, ZARR
from addvc.errors import ScanError
from addvc.images.levels import bin_mean
from addvc.images.scans_formats import (
    ScanFormat,
    Source,
    is_pattern,
    open_hdf5,
    open_npy,
)
from addvc.images.scans_itk import SUFFIXES as ITK_SUFFIXES
from addvc.images.scans_itk import open_itk
from addvc.images.scans_raw import open_raw
from addvc.images.scans_store import load_volume, save_volume
from addvc.images.scans_tiff import open_stack, open_tiff
from addvc.images.scans_zarr import open_zarr

__all__ = [
    "Scan",
    "ScanError",
    "ScanFormat",
    "load_volume",
    "open_scan",
    "read_binned",
    "save_volume",
]

Crop = Sequence[Sequence[int | None] | None] | None

OPENERS: dict[str, Callable[[Path, ScanFormat], Source]] = {
    **dict.fromkeys(TIFF, open_tiff),
    **dict.fromkeys((".raw", ".vol", ".bin"), open_raw),
    ".npy": open_npy,
    **dict.fromkeys((".h5", ".hdf5"), open_hdf5),
    **dict.fromkeys(ITK_SUFFIXES, open_itk),
    ZARR: open_zarr,
}
MIN_SIZE = 16  # voxels in each direction after binning
SLAB_VOXELS = 2**24  # read at once: 64 MB as float32


@dataclass(frozen=True)
class Scan:
    """A scan on disk: shape (nx, ny, nz) in voxels, grey type, and slabs on demand."""

    path: Path
    shape: tuple[int, int, int]
    dtype: np.dtype
    axes: str
    source: Source = field(repr=False)

    @property
    def slow_axis(self) -> int:
        """0, 1 or 2 for x, y or z: the axis along which the file is cut into slabs."""
        return "xyz".index(self.axes[0])

    def slab(self, start: int, stop: int) -> NDArray:
        """Slices start to stop along the slow axis, as (x, y, z); only these are read.

        Raises ScanError when they are none, or not all within the scan; also for a TIFF page that
        turns out to be damaged.
        """
        n = self.shape[self.slow_axis]
        if not 0 <= start < stop <= n:
            raise ScanError(f"{self.path}: slab {start} to {stop} is not within 0 to {n} slices")
        return self.source.read(start, stop).transpose(_to_xyz(self.axes))


def open_scan(
    path: str | os.PathLike, fmt: ScanFormat | None = None, every_slice: bool = True
) -> Scan:
    """Open a file of one of OPENERS, a folder of TIFF slices or a pattern of their names.

    Reads headers only; of slices, that of each, or of the first and last. Raises ScanError when it
    is missing, unknown, truncated, not three-dimensional or not of real grey values.
    """
    path, fmt = Path(path), fmt or ScanFormat()
    if sorted(fmt.axes) != ["x", "y", "z"]:
        raise ScanError(
            f"axes is '{fmt.axes}'; use a permutation of 'xyz', slowest first, such as 'zyx'"
        )
    source = _open_source(path, fmt, every_slice)
    if len(source.shape) != 3:
        raise ScanError(f"{path}: has {len(source.shape)} dimensions, {source.shape}; 3 are needed")
    if source.dtype.kind not in "buif":
        raise ScanError(f"{path}: values are {source.dtype}; convert them to integer or real grey")
    nx, ny, nz = (int(source.shape[axis]) for axis in _to_xyz(fmt.axes))
    return Scan(path, (nx, ny, nz), source.dtype, fmt.axes, source)


def _to_xyz(axes: str) -> tuple[int, ...]:
    """Which axis of the file is x, y and z."""
    return tuple(axes.index(name) for name in "xyz")


def _open_source(path: Path, fmt: ScanFormat, every_slice: bool) -> Source:
    """Choose the opener by what the path is: a pattern, a folder, or a file with a suffix."""
    if is_pattern(path):
        return open_stack([Path(file) for file in glob.glob(str(path))], str(path), every_slice)
    if not path.exists():
        where = "an absolute path" if path.is_absolute() else f"relative to {Path.cwd()}"
        raise ScanError(f"{path}: no such file or folder ({where}); correct the path")
    if path.is_dir() and path.suffix != ZARR:
        files = [file for file in path.iterdir() if file.suffix.lower() in TIFF]
        files = [file for file in files if not file.name.startswith(".")]
        return open_stack(files, str(path), every_slice)
    _check_keys(path, fmt)
    opener = OPENERS.get(path.suffix.lower())
    if opener is None:
        known = ", ".join(OPENERS)
        raise ScanError(
            f"{path}: unknown suffix '{path.suffix}'; known are {known}, a folder of TIFF slices, "
            "or a pattern such as 'scan_*.tif'"
        )
    return opener(path, fmt)


def _check_keys(path: Path, fmt: ScanFormat) -> None:
    """ScanError for keys that a format has no use for, and that would be left aside without a word."""
    suffix = path.suffix.lower()
    wrong = []
    if fmt.dataset is not None and suffix not in (".h5", ".hdf5", ZARR):
        wrong.append("scans.dataset is for HDF5 and Zarr")
    if (fmt.shape or fmt.dtype) and OPENERS.get(suffix, open_raw) is not open_raw:
        wrong.append("scans.shape and dtype are for raw files")
    if wrong:
        raise ScanError(f"{path}: {'; '.join(wrong)}; leave them out for a {suffix} file")


def crop_bounds(shape: Sequence[int], crop: Crop) -> list[tuple[int, int]]:
    """Start and stop of each axis, from python slices; None keeps all.

    Unlike a python slice, bounds outside of the scan are an error.
    """
    bounds = []
    for name, n, part in zip("xyz", shape, crop or (None,) * 3, strict=True):
        first, last = part or (None, None)
        start, stop, _ = slice(first, last).indices(n)
        if max(abs(first or 0), abs(last or 0)) > n or start >= stop:
            raise ScanError(
                f"crop of {name} is {first} to {last}, but the scan has {n} voxels along {name}; "
                f"use START < STOP within 0 to {n}"
            )
        bounds.append((start, stop))
    return bounds


def binned_shape(scan: Scan, factor: int, crop: Crop) -> tuple[int, ...]:
    """Size (nx, ny, nz) of the cropped and binned image, in its voxels.

    Raises ScanError when `factor` is not a whole number of at least 1, the crop leaves the scan or
    keeps nothing of it, or less than 16 voxels remain in a direction.
    """
    if isinstance(factor, bool) or factor != int(factor) or factor < 1:
        raise ScanError(f"bin is {factor}; use a whole number of at least 1")
    shape = tuple((stop - start) // int(factor) for start, stop in crop_bounds(scan.shape, crop))
    if min(shape) < MIN_SIZE:
        raise ScanError(
            f"{scan.path}: {scan.shape} voxels, cropped and binned by {factor}, leave {shape}; at "
            f"least {MIN_SIZE} are needed in each direction: use a smaller bin or a larger crop"
        )
    return shape


def read_binned(
    scan: Scan,
    factor: int = 1,
    crop: Crop = None,
    progress: Callable[[int, int], None] | None = None,
) -> NDArray[np.float32]:
    """The scan, cropped, then block-averaged by `factor`: (nx, ny, nz) float32.

    crop: ((x0, x1), (y0, y1), (z0, z1)) in voxels of the scan, python slices, None for all.
    progress(done, total): called after each slab with numbers of slices. One slab is in memory at
    a time, or the whole of a file that cannot be read in parts. Raises ScanError for NaN or infinite
    values and for a constant image.
    """
    shape = binned_shape(scan, factor, crop)
    bounds = crop_bounds(scan.shape, crop)
    volume = np.empty(shape, np.float32)
    seen, total = _Seen(scan, bounds), shape[scan.slow_axis] * factor
    for start, stop in _slabs(scan, total, factor):
        slab = _cropped_slab(scan, bounds, start, stop)
        seen.add(slab, start)
        where = [slice(None)] * 3
        where[scan.slow_axis] = slice(start // factor, stop // factor)
        volume[tuple(where)] = bin_mean(slab, factor)
        if progress is not None:
            progress(stop, total)
    seen.check()
    return volume


def _slabs(scan: Scan, total: int, factor: int) -> Iterator[tuple[int, int]]:
    """Starts and stops within `total` slices, multiples of `factor`, of about SLAB_VOXELS each."""
    page = int(np.prod(scan.shape)) // scan.shape[scan.slow_axis]
    step = max(SLAB_VOXELS // (page * factor), 1) * factor
    for start in range(0, total, step):
        yield start, min(start + step, total)


def _cropped_slab(scan: Scan, bounds: Sequence[tuple[int, int]], start: int, stop: int) -> NDArray:
    """Slices start to stop of the crop (counted from its first one), as (x, y, z)."""
    first = bounds[scan.slow_axis][0]
    window = [slice(*pair) for pair in bounds]
    window[scan.slow_axis] = slice(None)
    return scan.slab(first + start, first + stop)[tuple(window)]


class _Seen:
    """What has been read so far: range of grey values, and values that are not finite."""

    def __init__(self, scan: Scan, bounds: Sequence[tuple[int, int]]) -> None:
        self.scan, self.origin = scan, np.array([start for start, _ in bounds])
        self.low, self.high = np.inf, -np.inf
        self.bad, self.first_bad = 0, (0, 0, 0)

    def add(self, slab: NDArray, start: int) -> None:
        """Note a slab whose first slice is `start`, counted from the first one of the crop."""
        low, high = slab.min(), slab.max()  # NaN if any is
        if np.isfinite(low) and np.isfinite(high):
            self.low, self.high = min(self.low, low), max(self.high, high)
            return
        bad = ~np.isfinite(slab)
        if not self.bad:
            shift = start * np.eye(3, dtype=int)[self.scan.slow_axis]
            here = np.array(np.unravel_index(np.argmax(bad), bad.shape))
            self.first_bad = tuple((here + self.origin + shift).tolist())
        self.bad += int(np.count_nonzero(bad))

    def check(self) -> None:
        """Raise ScanError when the scan is no image."""
        if self.bad:
            raise ScanError(
                f"{self.scan.path}: {self.bad} voxels are NaN or infinite, the first at (x, y, z) "
                f"= {self.first_bad} of the scan; crop them away (scans.crop), or replace them"
            )
        if self.low == self.high:
            raise ScanError(
                f"{self.scan.path}: every voxel is {self.low}; an image with structure is needed: "
                "check the file, and shape, dtype and crop if given"
            )
