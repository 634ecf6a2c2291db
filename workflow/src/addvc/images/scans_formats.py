"""How each kind of scan file is opened: its shape, its grey type and a reader of its slices.

Every opener maps (path, format) to a `Source`, still in the file's own axis order, slowest first;
`scans.open_scan` turns that into (x, y, z). Readers open their file anew for each slab, so that no
memory map or handle outlives it, but for formats that cannot be read in parts (`scans_itk`).
"""

import glob
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from addvc.errors import ScanError


@dataclass(frozen=True)
class ScanFormat:
    """What a file does not say about itself.

    axes: order of the axes as stored, slowest first: 'zyx' for TIFF pages along z, rows along y.
    shape, dtype, byte_order ('little' or 'big'), header_bytes: of raw files only, the shape in the
    file's own axis order. dataset: path inside an HDF5 or Zarr file that holds several volumes.
    """

    axes: str = "zyx"
    shape: tuple[int, int, int] | None = None
    dtype: str | None = None
    byte_order: str = "little"
    header_bytes: int = 0
    dataset: str | None = None


@dataclass(frozen=True)
class Source:
    """An opened scan in the file's own axis order.

    read(start, stop) -> slices along the first axis, (stop - start, ...); files: what holds them;
    spacing: edges of a voxel as the header has them, in its own unit, None where it says nothing.
    """

    shape: tuple[int, ...]
    dtype: np.dtype
    read: Callable[[int, int], NDArray]
    files: tuple[Path, ...]
    spacing: tuple[float, ...] | None = None


def is_pattern(path: Path) -> bool:
    """Whether the name is a glob pattern such as 'scan_*.tif' rather than a file or folder."""
    return glob.has_magic(str(path)) and not path.exists()


def natural_key(name: str) -> list[tuple[int, int | str]]:
    """Sort key by which 'scan_9' comes before 'scan_10'."""
    parts = re.split(r"(\d+)", name)
    return [(0, int(part)) if part.isdigit() else (1, part) for part in parts if part]


def open_npy(path: Path, fmt: ScanFormat) -> Source:
    """An array saved by numpy, memory-mapped slab by slab.

    Raises ScanError when the file holds none, or is truncated.
    """
    try:
        array = np.load(path, mmap_mode="r", allow_pickle=False)
    except (ValueError, EOFError) as error:
        raise ScanError(
            f"{path}: not a readable .npy array ({error}); copy it again or save it with numpy.save"
        ) from error

    def read(start: int, stop: int) -> NDArray:
        return np.load(path, mmap_mode="r", allow_pickle=False)[start:stop]

    return Source(array.shape, array.dtype, read, (path,))


def open_hdf5(path: Path, fmt: ScanFormat) -> Source:
    """A dataset of an HDF5 file; `dataset` may be left out when there is one volume only.

    Raises ScanError when the file cannot be read, has no such dataset, or none is named and it does
    not hold exactly one volume.
    """
    try:
        with h5py.File(path, "r") as file:
            name = fmt.dataset or only_volume(path, _volumes(file))
            found = file.get(name)
            if not isinstance(found, h5py.Dataset):
                names = ", ".join(_volumes(file)) or "(none)"
                raise ScanError(
                    f"{path}: no dataset '{name}'; set scans.dataset to one of: {names}"
                )
            shape, dtype = found.shape, found.dtype
    except OSError as error:
        raise ScanError(f"{path}: not a readable HDF5 file ({error}); copy it again") from error

    def read(start: int, stop: int) -> NDArray:
        with h5py.File(path, "r") as file:
            return file[name][start:stop]

    return Source(shape, dtype, read, (path,))


def _volumes(file: h5py.File) -> list[str]:
    """Names of the three-dimensional datasets of an HDF5 file."""
    names: list[str] = []

    def note(name: str, item: object) -> None:
        if isinstance(item, h5py.Dataset) and item.ndim == 3:
            names.append(name)

    file.visititems(note)
    return names


def only_volume(path: Path, names: Sequence[str]) -> str:
    """The one volume of a file that has volumes of these names; ScanError unless there is one."""
    if len(names) != 1:
        raise ScanError(
            f"{path}: holds {len(names)} three-dimensional datasets, 1 is needed; "
            f"set scans.dataset{' to one of: ' + ', '.join(names) if names else ''}"
        )
    return names[0]
