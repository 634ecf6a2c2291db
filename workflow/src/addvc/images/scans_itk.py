"""NRRD, MetaImage and NIfTI scans, by SimpleITK."""

import gzip
import re
import zlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.typing import NDArray

from addvc.config import HEADER_BYTES, voxel_file
from addvc.errors import ConfigError, ScanError
from addvc.images.scans_formats import ScanFormat, Source

if TYPE_CHECKING:
    import SimpleITK as sitk

T = TypeVar("T")

SUFFIXES = (".nrrd", ".nhdr", ".mha", ".mhd", ".nii", ".gz")

PACKED = re.compile(rb"^(CompressedData\s*=\s*True|encoding:\s*(?!raw)\w)", re.MULTILINE | re.I)
"""How the header of a MetaImage or NRRD file says that its voxels are compressed."""


def open_itk(path: Path, fmt: ScanFormat) -> Source:
    """A .nrrd, .nhdr, .mha, .mhd, .nii or .nii.gz file; its voxel size is told, but not used.

    NRRD and compressed files cannot be read in part: they are held whole from the first slab on. Raises
    ScanError when the file cannot be read or is truncated, or its voxels are colours or vectors."""
    data = _voxels_of(path)
    reader = _reader(path)
    _run(path, reader.ReadImageInformation)
    if reader.GetNumberOfComponents() != 1:
        raise ScanError(
            f"{path}: has {reader.GetNumberOfComponents()} values a voxel (1 is needed); convert it to "
            "grey"
        )
    size, dtype = reader.GetSize(), _dtype(reader)
    if is_held(path):
        read = _reader_of_all(path)
        if not _packed(path):
            _check_length(data, int(np.prod(size)) * dtype.itemsize)
    else:
        read = _reader_of_parts(path, size)
        read(size[-1] - 1, size[-1])  # the end of a truncated file is missing
    edges = tuple(reader.GetSpacing())
    files = tuple(dict.fromkeys((data, path)))
    return Source(tuple(size[::-1]), dtype, read, files, None if set(edges) == {1} else edges)


def _dtype(reader: "sitk.ImageFileReader") -> np.dtype:
    """The grey type that a reader gives."""
    import SimpleITK as sitk  # slow to load, and most runs do without

    blank = sitk.Image([1] * reader.GetDimension(), reader.GetPixelID())
    return sitk.GetArrayViewFromImage(blank).dtype


def _reader_of_parts(path: Path, size: Sequence[int]) -> Callable[[int, int], NDArray]:
    """Slices along the slowest axis; `size`: that of all, the fastest axis first."""
    import SimpleITK as sitk

    def read(start: int, stop: int) -> NDArray:
        part = _reader(path)
        part.SetExtractIndex([0] * (len(size) - 1) + [start])
        part.SetExtractSize([*size[:-1], stop - start])
        return sitk.GetArrayFromImage(_run(path, part.Execute))

    return read


def _reader_of_all(path: Path) -> Callable[[int, int], NDArray]:
    """Slices of what is read at once, and held."""
    import SimpleITK as sitk

    held: list[sitk.Image] = []

    def read(start: int, stop: int) -> NDArray:
        if not held:
            _check_gzip(path)
            held.append(_run(path, _reader(path).Execute))
        return sitk.GetArrayViewFromImage(held[0])[start:stop]

    return read


def is_held(path: Path) -> bool:
    """Whether a scan cannot be read in parts: one of NRRD, or with compressed voxels."""
    return path.suffix.lower() in (".nrrd", ".nhdr") or _packed(path)


def _voxels_of(path: Path) -> Path:
    """The file that has the voxels, which can be read."""
    if path.suffix.lower() == ".gz" and not path.name.lower().endswith(".nii.gz"):
        raise ScanError(f"{path}: of packed files .nii.gz is known only; unpack it")
    try:
        data = voxel_file(path)
        with data.open("rb"):
            return data
    except OSError as error:
        raise ScanError(f"{path}: cannot be read ({error.strerror}); make it readable") from error
    except ConfigError as error:
        raise ScanError(str(error)) from error


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
