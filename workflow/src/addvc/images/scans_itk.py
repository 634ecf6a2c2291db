"""NRRD, MetaImage and NIfTI scans, by SimpleITK."""

import gzip
import re
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.typing import NDArray

from addvc.config import header_data
from addvc.errors import ScanError
from addvc.images.scans_formats import ScanFormat, Source

if TYPE_CHECKING:
    import SimpleITK as sitk

T = TypeVar("T")

SUFFIXES = (".nrrd", ".nhdr", ".mha", ".mhd", ".nii", ".gz")

PACKED = re.compile(rb"^(CompressedData *= *True|encoding: *(?!raw)\w)", re.MULTILINE)
"""How the header of a MetaImage or NRRD file says that its voxels are compressed."""

HEADER_BYTES = 4096


def open_itk(path: Path, fmt: ScanFormat) -> Source:
    """A .nrrd, .nhdr, .mha, .mhd, .nii or .nii.gz file; its voxel size is not used.

    NRRD and compressed files cannot be read in part: they are held whole from the first slab on. Raises
    ScanError when the file cannot be read or is truncated, or its voxels are colours or vectors."""
    import SimpleITK as sitk  # slow to load, and most runs do without

    reader = _reader(path)
    _run(path, reader.ReadImageInformation)
    if reader.GetNumberOfComponents() != 1:
        raise ScanError(
            f"{path}: has {reader.GetNumberOfComponents()} values a voxel (1 is needed); convert it to "
            "grey"
        )
    size = reader.GetSize()
    blank = sitk.Image([1] * len(size), reader.GetPixelID())
    dtype = sitk.GetArrayViewFromImage(blank).dtype
    data, packed = header_data(path), _packed(path)
    if not packed:
        _check_length(data, int(np.prod(size)) * dtype.itemsize)
    in_parts = not packed and path.suffix.lower() not in (".nrrd", ".nhdr")
    whole: list[NDArray] = []

    def read(start: int, stop: int) -> NDArray:
        if in_parts:
            part = _reader(path)
            part.SetExtractIndex([0] * (len(size) - 1) + [start])
            part.SetExtractSize([*size[:-1], stop - start])
            return sitk.GetArrayFromImage(_run(path, part.Execute))
        if not whole:
            _check_gzip(path)
            whole.append(sitk.GetArrayFromImage(_run(path, _reader(path).Execute)))
        return whole[0][start:stop]

    return Source(tuple(size[::-1]), dtype, read, tuple(dict.fromkeys((path, data))))


def _reader(path: Path) -> "sitk.ImageFileReader":
    """A reader of a file, which has read nothing."""
    import SimpleITK as sitk

    reader = sitk.ImageFileReader()
    reader.SetFileName(str(path))
    return reader


def _run(path: Path, call: Callable[[], T]) -> T:
    """What a reader of a file gives; ScanError with the last line of what ITK says against it."""
    try:
        return call()
    except RuntimeError as error:
        said = str(error).strip().splitlines()[-1:]
        raise ScanError(
            f"{path}: cannot be read ({''.join(said)}); copy the file again, or save it anew"
        ) from error


def _packed(path: Path) -> bool:
    """Whether the voxels are compressed."""
    with path.open("rb") as file:
        return path.suffix.lower() == ".gz" or bool(PACKED.search(file.read(HEADER_BYTES)))


def _check_gzip(path: Path) -> None:
    """ScanError where a .gz file ends too early, of which ITK says nothing."""
    if path.suffix.lower() != ".gz":
        return
    try:
        with gzip.open(path) as file:
            while file.read(2**24):
                pass
    except (OSError, EOFError, zlib.error) as error:
        raise ScanError(f"{path}: cannot be unpacked ({error}); copy the file again") from error


def _check_length(data: Path, least: int) -> None:
    """ScanError where a file is shorter than the voxels that it is to hold."""
    found = data.stat().st_size
    if found < least:
        raise ScanError(
            f"{data}: holds {found} bytes (at least {least} for the voxels that its header promises); "
            "copy the file again"
        )
