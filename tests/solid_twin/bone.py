"""A virtual compression of any scan: its solid is meshed, compressed by the solver, and the scan
itself is warped by what came out. A truth for real grey levels, such as trabecular bone.

`PYTHONPATH=workflow/src:tests python -m solid_twin.bone SCAN.tif FOLDER --threshold 84 --spacing 5`

The ends along y are clamped and displaced; the sides are free. FOLDER gets state0.tif (the scan as
it is), state1.tif and truth.h5, for a configuration with `scans` and `truth`.
"""

import argparse
import logging
import time
from pathlib import Path

import numpy as np
import tifffile

from addvc.analysis.mesh_truth import save_mesh_truth
from addvc.fem.mesh import Mesh, check_mesh
from addvc.geometry.stuffing import stuff
from addvc.geometry.tets import largest_piece
from solid_twin.compression import Step, compress
from solid_twin.equilibrium import Options
from solid_twin.platens import Press
from solid_twin.scans import write_stack
from solid_twin.solid import Solid, Tetrahedra, quadratic
from solid_twin.warp import warp

log = logging.getLogger("solid_twin")


def mesh_of(volume: np.ndarray, threshold: float, spacing: float) -> Mesh:
    """Linear tetrahedra of the largest piece of {volume > threshold}, voxels."""
    mesh, pieces = largest_piece(stuff(volume.astype(np.float32), threshold, spacing))
    log.info("%s", check_mesh(mesh, "solid") | pieces)
    return mesh


def compressed(
    mesh: Mesh, strain: float, grip: float = 2.0, options: Options | None = None
) -> tuple[Tetrahedra, Step]:
    """Quadratic tetrahedra of a mesh and their equilibrium when its ends along y, the outermost
    `grip` voxels, are clamped and come together by `strain` times its height less both grips."""
    low, high = mesh.points[:, 1].min() + grip, mesh.points[:, 1].max() - grip
    start, solid = time.process_time(), Solid(quadratic(mesh))

    def each(step: Step) -> None:
        log.info("strain %.4f, force %.4g, %d factorisations, %.0f CPU-s",
                 step.strain, step.force, step.solves, time.process_time() - start)  # fmt: skip

    (step,) = compress(solid, Press(low, high, contact=False), [strain], options, each)
    return solid.mesh, step


def write_case(scan: Path, folder: Path, given: argparse.Namespace) -> None:
    """The scan, its virtual state and the truth."""
    volume = tifffile.imread(scan).transpose(2, 1, 0)
    linear = mesh_of(volume, given.threshold, given.spacing)
    mesh, step = compressed(linear, given.strain, options=Options(increment=given.increment))
    moved, twice = warp(volume, mesh, step.x, given.noise, seed=2417)
    log.info("%.2g of the solid is there twice", twice)
    write_stack(folder / "state0.tif", volume)
    write_stack(folder / "state1.tif", moved)
    save_mesh_truth(
        folder / "truth.h5",
        mesh.points,
        mesh.cells,
        [step.x - mesh.points],
        np.array([step.strain]),
    )


if __name__ == "__main__":
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scan", type=Path, help="TIFF, pages z, rows y, columns x")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--threshold", type=float, required=True, help="grey level of the surface")
    parser.add_argument("--spacing", type=float, default=4.0, help="of the mesh's lattice, voxels")
    parser.add_argument("--strain", type=float, default=0.05)
    parser.add_argument("--increment", type=float, default=0.0125, help="of the strain")
    parser.add_argument("--noise", type=float, default=5.0, help="grey levels")
    given = parser.parse_args()
    write_case(given.scan, given.folder, given)
