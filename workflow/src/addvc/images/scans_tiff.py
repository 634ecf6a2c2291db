"""TIFF scans: one file of many pages, or many files of one page."""

import logging
import re
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import tifffile
from numpy.typing import NDArray

from addvc.errors import ScanError
from addvc.images.scans_formats import ScanFormat, Source, natural_key

_BROKEN = (tifffile.TiffFileError, ValueError, RuntimeError, OSError, IndexError, zlib.error)


def open_tiff(path: Path, fmt: ScanFormat) -> Source:
    """A TIFF file of many pages, of its one series with three dimensions."""
    shape, dtype, offset = _describe(path, dimensions=3)

    def read(start: int, stop: int) -> NDArray:
        if offset is None:
            return _read_pages(path, start, stop)
        skip = offset + start * int(np.prod(shape[1:])) * dtype.itemsize
        return np.memmap(path, dtype, "r", offset=skip, shape=(stop - start, *shape[1:]))

    return Source(shape, dtype, read, (path,))


def open_stack(files: Sequence[Path], name: str, every_slice: bool = True) -> Source:
    """Single-page TIFF files, sorted by the numbers in their names, one slice each.

    name: what the user wrote (a folder or a pattern), for the messages. every_slice: open each, not
    the first and last alone (1,654 slices take half a second on a local disk). Raises ScanError when
    there is no file, a number is missing between two, or a file that is opened is truncated, not one
    grey slice, or differs from the first in size or type.
    """
    files = tuple(sorted(files, key=lambda file: natural_key(file.name)))
    if not files:
        raise ScanError(f"{name}: no TIFF file found; give a folder or pattern of one file a slice")
    _check_numbers(files, name)
    shape, dtype, _ = _describe(files[0], dimensions=2)
    for file in files[1:] if every_slice else files[1:][-1:]:
        other, kind, _ = _describe(file, dimensions=2)
        if (other, kind) != (shape, dtype):
            raise ScanError(
                f"{name}: {file.name} is {other} {kind}, but {files[0].name} is {shape} {dtype}; "
                "all slices must have one size and type: remove or convert the odd ones"
            )

    def read(start: int, stop: int) -> NDArray:
        return np.stack([_read_pages(file, 0, 1)[0] for file in files[start:stop]])

    return Source((len(files), *shape), dtype, read, files)


def _check_numbers(files: Sequence[Path], name: str) -> None:
    """Slices numbered by the last number of their names must have none missing."""
    found = [re.fullmatch(r"(.*?)(\d+)(\D*)", file.name) for file in files]
    if not all(found) or len({match.group(1, 3) for match in found if match}) != 1:
        return
    numbers = np.array([int(match.group(2)) for match in found if match])
    steps = np.diff(numbers)
    if len(steps) and steps.max() > steps.min():
        at = int(np.argmax(steps))
        raise ScanError(
            f"{name}: slice numbers go from {numbers[at]} to {numbers[at + 1]} where others go up "
            f"by {steps.min()}; put the missing files back, or renumber what is there (a folder or a "
            "pattern is one scan: list several scans one by one)"
        )


def _describe(path: Path, dimensions: int) -> tuple[tuple[int, ...], np.dtype, int | None]:
    """Shape, grey type and, when the voxels are one uncompressed block, its offset in bytes."""
    with _whole(path), tifffile.TiffFile(path) as file:
        if len(file.series) != 1:
            sizes = "; ".join(str(series.shape) for series in file.series[:4])
            raise ScanError(
                f"{path}: holds {len(file.series)} images of different size or type ({sizes}), "
                "1 is needed; save the scan alone"
            )
        series = file.series[0]
        _check_series(path, series, dimensions)
        _check_length(path, series)
        offset = series.dataoffset
        order = series.dtype.newbyteorder(file.byteorder)
    return series.shape, order if offset is not None else series.dtype, offset


def _check_series(path: Path, series: tifffile.TiffPageSeries, dimensions: int) -> None:
    """Grey, of the right number of dimensions, and one page a slice (unless one block)."""
    if "S" in series.axes:
        raise ScanError(
            f"{path}: is a colour image, {series.shape} with axes {series.axes}; convert it to grey"
        )
    if series.ndim != dimensions:
        remedy = (
            "give a volume as one file of many pages, or as a folder with one single page a file"
        )
        if series.ndim == 3:
            remedy = (
                "the files that a folder or a pattern holds are the slices of one scan, but this file "
                "is a scan by itself: list such files one by one (states: [first.tif, second.tif])"
            )
        raise ScanError(
            f"{path}: has {series.ndim} dimensions, {series.shape}, {dimensions} are needed; {remedy}"
        )
    if dimensions == 3 and series.dataoffset is None and len(series.pages) != series.shape[0]:
        raise ScanError(
            f"{path}: {len(series.pages)} pages hold {series.shape[0]} slices; "
            "save it again with one page a slice"
        )


def _check_length(path: Path, series: tifffile.TiffPageSeries) -> None:
    """All data that the pages point to must lie inside the file."""
    size = path.stat().st_size
    if series.dataoffset is not None:
        end = series.dataoffset + series.nbytes
    else:
        parts = (zip(p.dataoffsets, p.databytecounts, strict=False) for p in series.pages if p)
        end = max(offset + count for page in parts for offset, count in page)
    if end > size:
        raise ScanError(f"{path}: {size} bytes, but its data end at {end}: {_TRUNCATED}")


_TRUNCATED = "the file is truncated or damaged; copy or export it again"


@contextmanager
def _whole(path: Path) -> Iterator[None]:
    """Turn signs of a truncated file, some of which tifffile only logs, into a ScanError."""
    messages: list[str] = []
    handler = logging.Handler(logging.WARNING)
    handler.emit = lambda record: messages.append(record.getMessage())  # type: ignore[method-assign]
    logger = logging.getLogger("tifffile")
    logger.addHandler(handler)
    try:
        yield
    except ScanError as error:
        if not _tells_damage(messages):
            raise
        raise _broken(path, messages[0]) from error
    except _BROKEN as error:
        raise _broken(path, str(error)) from error
    finally:
        logger.removeHandler(handler)
    if _tells_damage(messages):
        raise _broken(path, messages[0])


def _broken(path: Path, told: str) -> ScanError:
    """That a file is not whole, with what the TIFF reader told of it."""
    size = path.stat().st_size
    return ScanError(f"{path}: {size} bytes: {_TRUNCATED} (the TIFF reader says: {told})")


def _tells_damage(messages: Sequence[str]) -> bool:
    """Whether the log of the TIFF reader speaks of a broken chain of pages."""
    return any("invalid page offset" in text or "corrupted" in text for text in messages)


def _read_pages(path: Path, start: int, stop: int) -> NDArray:
    """Pages start to stop of a TIFF file, (stop - start, rows, columns)."""
    with _whole(path), tifffile.TiffFile(path) as file:
        pages = file.asarray(key=slice(start, stop), series=0)
        return pages.reshape(stop - start, *pages.shape[-2:])
