"""All scans of a case at once, before any work: there, whole, of one size and type. Headers only."""

import hashlib
import os
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from addvc.config import scan_files, scan_paths, scan_settings, voxel_size_um
from addvc.errors import ConfigError, ScanError, refuse
from addvc.images.platens import given_faces
from addvc.images.scans import Crop, Scan, ScanFormat, binned_shape, open_scan

FINGERPRINT_BYTES = 2**20
WHAT = " with the scans"
UNITS_UM = (1, 1e3, 1e6)  # micrometres, millimetres, metres
ALIKE = 0.02  # what two voxel sizes that are meant to be one may differ by


class Checked(NamedTuple):
    """A scan, and its size (x, y, z) once cropped and binned."""

    scan: Scan
    binned: tuple[int, ...]


def check_scans(
    paths: Sequence[str | os.PathLike], fmt: ScanFormat | None, factor: int = 1, crop: Crop = None
) -> list[dict]:
    """Open every scan and compare sizes and grey types.

    Gives for each: path, shape and binned_shape (x, y, z), dtype, bytes on disk, and fingerprint,
    a sha256 of the first MB and the size. The fingerprint tells scans apart in a record of
    provenance; it is no checksum, since a change behind the first MB leaves it as it is. Raises
    ScanError with all that is wrong.
    """
    found, problems = open_all(paths, fmt or ScanFormat(), factor, crop)
    refuse(problems, ScanError, WHAT)
    return [_record(checked) for checked in found]


def check_headers(config: dict) -> str:
    """ScanError with all that is wrong with the scans of a configuration, as a dry run can tell it; what
    they are, in a line, where nothing is.

    Of a scan in one file a slice the first and last are opened: 1,654 take 0.4 s on a local disk."""
    there, problems, names = [], [], {}
    for number, path in enumerate(scan_paths(config)):
        name = f"scans.states[{number - 1}]" if number else "scans.reference"
        try:
            files = tuple(os.path.realpath(file) for file in scan_files(path))
            files = files[-1:] if os.path.isfile(path) else files  # the voxels, not their header
            if files in names:
                problems.append(
                    f"{name} is the same scan as {names[files]}, {path}; list each scan once"
                )
                continue
            names[files] = name
            there.append(path)
        except ConfigError as error:
            problems.append(str(error))
    known = scan_settings(config, 0)
    form = ScanFormat(**known["format"])
    found, wrong = open_all(there, form, known["bin"], known["crop"], every_slice=False)
    refuse(problems + wrong, ScanError, WHAT)
    region = config.get("micro", {}).get("region", "all")
    length = found[0].binned["xyz".index(config["loading_axis"])]
    check_slab(region, length)
    if isinstance(platens := config["scans"].get("platens"), list):
        given_faces(platens, length)
    check_cell(config.get("geometry", {}).get("cell_size"), found[0].binned)
    voxel_um = voxel_size_um(config)
    said = described(found[0], len(found), voxel_um, known["bin"])
    return said + spacing_words(found[0].scan.source.spacing, voxel_um)


def check_cell(cell_size: str | float | None, shape: tuple[int, ...]) -> None:
    """ConfigError where `geometry.cell_size` is more than half of an image of this shape (voxels)."""
    if isinstance(cell_size, int | float) and cell_size > min(shape) / 2:
        raise ConfigError(
            f"geometry.cell_size is {cell_size:g} voxels (at most {min(shape) / 2:g}, half of the least "
            "side of the image once cropped and binned): give it in voxels, not micrometres"
        )


def edge_words(spacing: Sequence[float]) -> str:
    """The edges of a voxel as a header has them: "0.02 x 0.02 x 0.05"."""
    return " x ".join(f"{edge:g}" for edge in spacing)


def spacing_words(spacing: Sequence[float] | None, voxel_um: float) -> str:
    """A warning where the header of a scan has voxels that are no cubes, or another voxel size, whatever
    its unit."""
    if spacing is None:
        return ""
    if max(spacing) > (1 + ALIKE) * min(spacing):
        return (
            f" (WARNING: the header has voxels of {edge_words(spacing)}, which are no cubes: lengths "
            "and strains will be wrong unless the header is; resample the scans to cubic voxels)"
        )
    if any(abs(spacing[0] * unit / voxel_um - 1) < ALIKE for unit in UNITS_UM):
        return ""
    return (
        f" (WARNING: the header has a voxel size of {spacing[0]:g}, which in no unit is the "
        f"{voxel_um:g} micrometres of scans.voxel_size_um)"
    )


def check_slab(region: str | dict, length: int) -> None:
    """ConfigError where the slab of `micro.region` lies outside an image of this length (voxels), or is
    higher."""
    wanted = {} if region == "all" else region
    if wanted.get("low", 0) >= length or wanted.get("high", length) <= 0:
        given = ", ".join(f"{key} = {wanted[key]:g}" for key in ("low", "high") if key in wanted)
        raise ConfigError(
            f"micro.region ({given}) lies outside of the image, which goes from 0 to {length} along the "
            "loading axis (voxels once cropped and binned, not micrometres): give a slab within that"
        )
    if wanted.get("height", 0) > length:
        raise ConfigError(
            f"micro.region.height is {wanted['height']:g} voxels (at most {length}, the image along the "
            "loading axis once cropped and binned): give it in voxels, not micrometres"
        )


def described(first: Checked, count: int, voxel_um: float, factor: int) -> str:
    """What the scans are, from the first of them."""
    whole, binned = (" x ".join(map(str, shape)) for shape in (first.scan.shape, first.binned))
    return (
        f"{count} scan{'s' * (count > 1)} of {whole} voxels (x, y, z) of {voxel_um:g} micrometres, "
        f"{first.scan.dtype.name}; {binned} of {voxel_um * factor:g} once cropped and binned"
    )


def open_all(
    paths: Sequence[str | os.PathLike],
    fmt: ScanFormat,
    factor: int,
    crop: Crop,
    every_slice: bool = True,
) -> tuple[list[Checked], list[str]]:
    """The scans that can be used, and what is wrong with the others: what several share, once."""
    found: list[Checked] = []
    problems: dict[str, list[str]] = {}
    for path in paths:
        try:
            scan = open_scan(path, fmt, every_slice)
            _check_like(scan, found[0].scan if found else scan)
            found.append(Checked(scan, binned_shape(scan, factor, crop)))
        except ScanError as error:
            problems.setdefault(str(error).replace(str(path), "SCAN"), []).append(str(error))
    return found, [_of_all(alike) for alike in problems.values()]


def _of_all(alike: Sequence[str]) -> str:
    """The first of problems that differ in the path alone, and how many more there are."""
    more = len(alike) - 1
    return alike[0] + (f" (so it is with {more} more scan{'s' * (more > 1)})" if more else "")


def _check_like(scan: Scan, first: Scan) -> None:
    """ScanError unless a scan has the size, the voxels, as far as headers say, and the grey type (in
    either byte order) of the first."""
    if scan.shape != first.shape:
        raise ScanError(
            f"{scan.path} has {scan.shape} voxels, but {first.path} has {first.shape}; "
            "all states must have one size: crop or export them alike"
        )
    edges, wanted = scan.source.spacing, first.source.spacing
    if edges and wanted and not np.allclose(edges, wanted, rtol=ALIKE, atol=0):
        raise ScanError(
            f"{scan.path} has voxels of {edge_words(edges)}, but {first.path} of {edge_words(wanted)}, "
            "as their headers say; all states must have one voxel size: resample them, or correct the "
            "headers"
        )
    if scan.dtype.newbyteorder("=") != first.dtype.newbyteorder("="):
        raise ScanError(
            f"{scan.path} has values of {scan.dtype.name}, but {first.path} of {first.dtype.name}; "
            "the grey levels of all states are compared: export them in one type"
        )


def _record(checked: Checked) -> dict:
    """What check_scans says of one scan."""
    scan = checked.scan
    size = sum(file.stat().st_size for file in scan.source.files)
    with open(scan.source.files[0], "rb") as file:
        digest = hashlib.sha256(file.read(FINGERPRINT_BYTES) + str(size).encode())
    return {
        "path": str(scan.path),
        "shape": list(scan.shape),
        "binned_shape": list(checked.binned),
        "dtype": scan.dtype.name,
        "bytes": size,
        "fingerprint": digest.hexdigest(),
    }
