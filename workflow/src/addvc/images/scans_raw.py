"""Raw scans: arrays without a header, so that the user says what they hold, and may be wrong."""

import itertools
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from addvc.errors import ScanError
from addvc.images.scans_formats import ScanFormat, Source

COMMON_DTYPES = ("uint8", "int8", "uint16", "int16", "uint32", "int32", "float32", "float64")
PAGES, VALUES = 4, 1_000_000  # in the middle of a scan, that are looked at; at least a page
LIKELIER = 0.7  # of how unlike neighbours are where another order is meant, at most
MOST_HEADER = 65536  # bytes that a header may be thought to have


def open_raw(path: Path, fmt: ScanFormat) -> Source:
    """A headerless array: header_bytes, then product(shape) values of `dtype`.

    Raises ScanError when shape or dtype is missing or impossible, byte_order unknown or header_bytes
    negative, or when the file is not exactly as long as they say.
    """
    if fmt.shape is None or fmt.dtype is None:
        raise ScanError(
            f"{path}: a {path.suffix} file does not say what it holds; give scans.shape (three "
            f"sizes in the order of axes, '{fmt.axes}') and scans.dtype (such as uint16)"
        )
    shape, dtype = tuple(int(n) for n in fmt.shape), _raw_dtype(path, fmt)
    if len(shape) != 3 or min(shape) < 1 or fmt.header_bytes < 0:
        raise ScanError(
            f"{path}: shape {fmt.shape} with header_bytes {fmt.header_bytes}; "
            "give three sizes of at least 1 and a header of at least 0 bytes"
        )
    _check_raw_size(path, fmt, shape, dtype)
    _check_raw_look(path, fmt, shape, dtype)
    page = int(np.prod(shape[1:]))

    def read(start: int, stop: int) -> NDArray:
        offset = fmt.header_bytes + start * page * dtype.itemsize
        values = np.fromfile(path, dtype, count=(stop - start) * page, offset=offset)
        return values.reshape(stop - start, *shape[1:])

    return Source(shape, dtype, read, (path,))


def _raw_dtype(path: Path, fmt: ScanFormat) -> np.dtype:
    """The grey type of a raw file, byte order included."""
    if fmt.byte_order not in ("little", "big"):
        raise ScanError(f"{path}: byte_order is '{fmt.byte_order}'; use 'little' or 'big'")
    try:
        dtype = np.dtype(fmt.dtype)
    except TypeError as error:
        raise ScanError(
            f"{path}: dtype '{fmt.dtype}' is unknown; use one of {', '.join(COMMON_DTYPES)}"
        ) from error
    if fmt.dtype.startswith(("<", ">")):
        order = "big" if fmt.dtype[0] == ">" else "little"
        raise ScanError(
            f"{path}: dtype is '{fmt.dtype}', a byte order and a type in one; say dtype: {dtype.name} "
            f"and byte_order: {order}"
        )
    return dtype.newbyteorder({"little": "<", "big": ">"}[fmt.byte_order])


def _check_raw_size(path: Path, fmt: ScanFormat, shape: tuple[int, ...], dtype: np.dtype) -> None:
    """The file must hold exactly the header and the voxels."""
    found, voxels = path.stat().st_size, int(np.prod(shape))
    expected = fmt.header_bytes + voxels * dtype.itemsize
    if found == expected:
        return
    others = [
        name
        for name in COMMON_DTYPES
        if fmt.header_bytes + voxels * np.dtype(name).itemsize == found
    ]
    hint = f"; the size would fit dtype {' or '.join(others)}" if others else ""
    if not others and 0 < found - voxels * dtype.itemsize <= MOST_HEADER:
        hint = f"; a header of {found - voxels * dtype.itemsize} bytes would fit"
    raise ScanError(
        f"{path}: expected {expected} bytes (header {fmt.header_bytes} + shape {shape} of "
        f"{dtype.name}), found {found}; correct scans.shape, dtype or header_bytes, "
        f"or copy the file again{hint}"
    )


def _check_raw_look(path: Path, fmt: ScanFormat, shape: tuple[int, ...], dtype: np.dtype) -> None:
    """ScanError where the voxels look like a scan in the other byte order only, or with the three sizes
    in another order: neighbours are then far more alike."""
    if min(shape) < PAGES:
        return
    flat = np.memmap(path, dtype, "r", fmt.header_bytes, (int(np.prod(shape)),))
    given, swapped = unlike(flat, shape), unlike(flat.view(dtype.newbyteorder()), shape)
    differ = "neighbours differ by {:.2g} of the scatter of all voxels, with {} by {:.2g}"
    if swapped[0] < LIKELIER * given[0]:
        order = {"little": "big", "big": "little"}[fmt.byte_order]
        words = differ.format(given[0], order, swapped[0])
        raise ScanError(
            f"{path}: with byte_order: {fmt.byte_order} {words}: say byte_order: {order}"
        )
    found = {sizes: max(unlike(flat, sizes)) for sizes in itertools.permutations(shape)}
    best = min(found, key=found.get)
    if found[best] < LIKELIER * found[shape]:
        words = differ.format(found[shape], list(best), found[best])
        raise ScanError(
            f"{path}: with shape {list(shape)} {words}: give scans.shape in the order of axes, "
            f"'{fmt.axes}'"
        )


def unlike(flat: NDArray, shape: Sequence[int]) -> tuple[float, float]:
    """How unlike neighbours are along rows and across them, in some pages of the middle of an array:
    mean absolute differences over the mean absolute deviation of all that are numbers; 1 where all is
    the same, infinite where over half are none."""
    page = shape[1] * shape[2]
    count = max(1, min(PAGES, VALUES // page))
    first = max(shape[0] // 2 - count // 2, 0) * page
    with np.errstate(all="ignore"):
        pages = flat[first : first + count * page].reshape(-1, *shape[1:]).astype(float)
        known = np.isfinite(pages)
        if known.mean() < 0.5:
            return np.inf, np.inf
        pages[~known] = np.nan
        scatter = np.nanmean(np.abs(pages - np.nanmean(pages)))
        along, across = (np.nanmean(np.abs(np.diff(pages, axis=axis))) for axis in (2, 1))
    if not np.isfinite(scatter):
        return np.inf, np.inf
    return (float(along / scatter), float(across / scatter)) if scatter > 0 else (1.0, 1.0)
