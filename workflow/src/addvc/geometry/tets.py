"""Tetrahedra inside a surface, by pytetwild, behind one function.

pytetwild (fTetWild) takes any triangle soup, so that a surface that crosses itself here and there
does no harm. Its envelope is relative to the diagonal of the bounding box: it is given in voxels
here. It never gives the same mesh twice (`geometry/meso.py` says why).
"""

import contextlib
import os
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from addvc.errors import MeshError
from addvc.fem.mesh import Mesh, face_components, oriented, submesh
from addvc.geometry.surface import Surface


@dataclass(frozen=True)
class TetOptions:
    """`edge_length` and `envelope` in voxels; the rest as fTetWild's optimiser has it."""

    edge_length: float
    envelope: float = 0.2
    stop_energy: float = 20.0
    passes: int = 5


@contextlib.contextmanager
def scratch_folder() -> Iterator[None]:
    """Run in a temporary folder: the mesher leaves files in the current one."""
    before = os.getcwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            yield
        finally:
            os.chdir(before)


def tetrahedralise(surface: Surface, options: TetOptions) -> Mesh:
    """Tetrahedra of the inside of a surface, positively oriented.

    Raises MeshError when the mesher returns nothing."""
    import pytetwild  # and with it pyvista, which the lattice does without

    diagonal = float(np.linalg.norm(np.ptp(surface.points, axis=0)))
    with scratch_folder():
        points, cells = pytetwild.tetrahedralize(
            surface.points,
            surface.faces,
            edge_length_abs=options.edge_length,
            epsilon=options.envelope / diagonal,
            stop_energy=options.stop_energy,
            num_opt_iter=max(options.passes, 1),
            optimize=options.passes > 0,
            num_threads=1,
        )
    if len(cells) == 0:
        raise MeshError(
            f"the mesher found no inside in a surface of {len(surface.faces)} "
            "triangles; check that it is closed and wound outwards"
        )
    return oriented(Mesh(points, cells))


def largest_piece(mesh: Mesh) -> tuple[Mesh, dict]:
    """The largest face-connected component, and how many were dropped with their share of cells."""
    label = face_components(mesh)
    keep = label == 0
    return submesh(mesh, keep), {
        "pieces": int(label.max()) + 1,
        "dropped_cells": int((~keep).sum()),
    }
