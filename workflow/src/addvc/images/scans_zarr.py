"""Zarr scans: an array, or a group with one or more of them."""

import logging
from pathlib import Path
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from addvc.errors import ScanError
from addvc.images.scans_formats import ScanFormat, Source, only_volume

if TYPE_CHECKING:
    import zarr

log = logging.getLogger(__name__)

BROKEN = (OSError, ValueError, RuntimeError, KeyError, TypeError)
"""What zarr raises where it cannot read."""


def open_zarr(path: Path, fmt: ScanFormat) -> Source:
    """A folder that zarr wrote; of a group `dataset`, or the one array that is a volume: of three
    dimensions, or of more that are 1 (time and channel of OME-Zarr).

    A chunk that is not there reads as the fill value, as Zarr has it, with a warning. Raises ScanError
    when the folder is not of zarr, has no such array, a chunk is damaged, or no array is named and it
    does not hold exactly one volume."""
    import zarr  # slow to load, and most runs do without

    try:
        found: Any = zarr.open(path, mode="r")
    except BROKEN as error:
        raise ScanError(f"{path}: not a readable Zarr folder ({error}); copy it again") from error
    if isinstance(found, zarr.Group):
        found = _chosen(path, found, (fmt.dataset or "").strip("/"))
    there, chunks = found.nchunks_initialized, found.nchunks
    if there < chunks:
        words = (
            "WARNING: %s: %d of %d chunks are there (others read as %s); copy it again, or go on"
        )
        log.warning(words, path, there, chunks, found.fill_value)

    more = found.ndim - 3 if is_volume(found) else 0

    def read(start: int, stop: int) -> NDArray:
        try:
            return found[(0,) * more + (slice(start, stop),)]
        except BROKEN as error:
            raise ScanError(f"{path}: a chunk is damaged ({error}); copy it again") from error

    files = tuple(sorted(file for file in path.rglob("*") if file.is_file()))
    return Source(found.shape[more:], found.dtype, read, files)


def is_volume(array: "zarr.Array") -> bool:
    """Whether all dimensions of an array but the last three are 1."""
    return array.ndim >= 3 and set(array.shape[:-3]) <= {1}


def _chosen(path: Path, group: "zarr.Group", dataset: str) -> "zarr.Array":
    """The array of a group that has this name, or the one volume in it."""
    arrays = {name: item for name, item in group.members(max_depth=None) if hasattr(item, "chunks")}
    volumes = sorted(name for name, item in arrays.items() if is_volume(item))
    name = dataset or only_volume(path, volumes)
    if name not in arrays:
        names = ", ".join(volumes) or "(none)"
        raise ScanError(f"{path}: no array '{name}'; set scans.dataset to one of: {names}")
    return arrays[name]
