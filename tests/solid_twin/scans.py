"""A case for the workflow: the scans of the compressed foam, as from a scanner, and its truth.

`PYTHONPATH=workflow/src:tests python -m solid_twin.scans [--noise 4] [FOLDER]`
"""

import argparse
import os
from pathlib import Path

import numpy as np
import tifffile

from addvc.analysis.mesh_truth import MeshTruth, save_mesh_truth
from addvc.images.files import atomic_path
from solid_twin.fixture import Record, load_record
from solid_twin.imaging import Imaging, scan

FOLDER = "results/solid_scans"


def solid_truth(compression: Record) -> MeshTruth:
    """The displacement of any point of the solid."""
    mesh = compression.mesh
    return MeshTruth(
        mesh.points,
        mesh.cells,
        compression.displacements,
        compression.strains,
        compression.platens,
    )


def write_stack(path: str | os.PathLike, volume: np.ndarray) -> None:
    """A volume (nx, ny, nz) as TIFF pages: page z, row y, column x."""
    with atomic_path(path) as temporary:
        tifffile.imwrite(temporary, volume.transpose(2, 1, 0), photometric="minisblack")


def write_case(folder: str | os.PathLike, imaging: Imaging) -> None:
    """`stateN.tif`, 0 for the reference, and `truth.h5`."""
    folder, compression = Path(folder), load_record()
    for state in range(len(compression.strains) + 1):
        write_stack(folder / f"state{state}.tif", scan(compression, state, imaging))
    mesh = compression.mesh
    save_mesh_truth(
        folder / "truth.h5",
        mesh.points,
        mesh.cells,
        compression.displacements,
        compression.strains,
        compression.platens,
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", nargs="?", default=FOLDER)
    parser.add_argument("--noise", type=float, default=Imaging.noise, help="grey levels")
    given = parser.parse_args()
    write_case(given.folder, Imaging(noise=given.noise))
