"""A real scan, such as trabecular bone, compressed on the computer: a truth for real grey levels.

The middle of the scan is meshed, compressed by the finite elements of `tests/solid_twin`, and warped
by the result, with fresh noise. What is written is a case of the workflow.
"""

from argparse import Namespace
from dataclasses import asdict, dataclass, fields
from pathlib import Path

import numpy as np
import tifffile
import yaml
from skimage.filters import threshold_otsu

from addvc.errors import ScanError
from solid_twin.bone import write_case
from solid_twin.scans import write_stack


@dataclass(frozen=True)
class BoneOptions:
    """`side` of the cube that is cut out, `spacing` of the lattice of the finite elements, voxels;
    `strain` and its `increment`; `noise` in grey levels."""

    side: int = 120
    spacing: float = 5.0
    strain: float = 0.05
    increment: float = 0.0125
    noise: float = 5.0

    @classmethod
    def of(cls, given: dict) -> "BoneOptions":
        """From a configuration; on a command line numbers are words."""
        kind = {item.name: type(item.default) for item in fields(cls)}
        return cls(**{name: kind[name](value) for name, value in given.items()})


MEASURE = {
    "mesh": {"size": 3.0},
    "meso": {"sizes": [33, 23, 12]},
    "freeform": {"spacing": 8},
    "loading_axis": "y",
}
"""Keys of the workflow: trabeculae are some ten voxels thick and stand far apart, so that lengths do
not follow the size of their cells."""


def middle(volume: np.ndarray, side: int) -> np.ndarray:
    """The cube of `side` voxels in the middle of (nx, ny, nz)."""
    if min(volume.shape) < side:
        raise ScanError(
            f"the scan has {volume.shape} voxels, {side} are to be cut out; lower bone.side"
        )
    first = [(n - side) // 2 for n in volume.shape]
    return volume[tuple(slice(a, a + side) for a in first)]


def write_bone(scan: str | Path, folder: Path, options: BoneOptions, voxel_size_um: float) -> None:
    """state0.tif, state1.tif, truth.h5 and config.yaml, from a TIFF with pages z, rows y, columns x."""
    volume = middle(tifffile.imread(scan).transpose(2, 1, 0), options.side)
    threshold = float(threshold_otsu(volume))
    write_stack(folder / "state0.tif", volume)
    write_case(folder / "state0.tif", folder, Namespace(threshold=threshold, **asdict(options)))
    scans = {
        "reference": f"{folder}/state0.tif",
        "states": [f"{folder}/state1.tif"],
        "voxel_size_um": voxel_size_um,
        **{"axes": "zyx", "platens": "none", "specimen": "box"},
    }
    case = {"case": "bone", "scans": scans, "truth": f"{folder}/truth.h5"}
    case |= {"porosity": round(float(np.mean(volume <= threshold)), 3)} | MEASURE
    (folder / "config.yaml").write_text(yaml.safe_dump(case, sort_keys=False))
