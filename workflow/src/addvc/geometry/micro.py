"""Fig. 8: the mesh of the struts, by the backend of the configuration, checked and reported."""

import logging

import numpy as np
from scipy.spatial import cKDTree

from addvc.errors import MeshError
from addvc.fem.mesh import Mesh, boundary_faces, cell_volumes, check_mesh
from addvc.geometry.region import Region, node_classes
from addvc.geometry.skeleton import strut_graph
from addvc.geometry.stubs import pruned
from addvc.geometry.stuffing import stuff
from addvc.geometry.surface import Surface, enclosed_volume, remeshed
from addvc.geometry.tets import TetOptions, largest_piece, tetrahedralise

log = logging.getLogger(__name__)


def micro_mesh(
    grey: np.ndarray, gamma: float, surface: Surface, region: Region, options: dict
) -> tuple[Mesh, dict]:
    """Tetrahedra (m, 4) of {grey > gamma}, grey (nx, ny, nz), in one piece, and the figures of the mesh,
    lengths in voxels.

    `surface`: the level set gamma, which pytetwild meshes the inside of and the mesh is compared with.
    `options` is the `mesh` section of the configuration; `mend: prune` cuts dangling stubs off. Raises
    MeshError when there is no cell, when the largest piece holds less than `min_kept` of the volume, or
    a cell is inverted or too flat."""
    mesh = meshed(grey, gamma, surface, options)
    whole = np.abs(cell_volumes(mesh)).sum() if len(mesh.cells) else 0.0
    if whole == 0:
        raise MeshError(
            f"no tetrahedron at mesh.size {options['size']}: struts are thinner than it; "
            "lower mesh.size"
        )
    mesh, pieces = largest_piece(mesh)
    if options["mend"] == "prune":
        cut = node_classes(mesh, region, "free")["surface"] > 0
        mesh, pieces["pruned_stubs"] = pruned(mesh, strut_graph(grey > gamma), cut)
    figures = check_mesh(mesh, "micro mesh", options["min_dihedral"]) | pieces
    figures |= {
        "kept_fraction": figures["volume"] / whole,
        "volume_over_surface": figures["volume"] / enclosed_volume(surface),
    }
    figures |= surface_distance(mesh, surface)
    report(figures, options)
    return mesh, figures


def meshed(grey: np.ndarray, gamma: float, surface: Surface, options: dict) -> Mesh:
    """Tetrahedra of {grey > gamma} by `backend`, in any number of pieces."""
    if options["backend"] == "pytetwild":
        return tetrahedralise(remeshed(surface, options["size"]), TetOptions(options["size"]))
    return stuff(grey, gamma, options["size"])


def surface_distance(mesh: Mesh, surface: Surface) -> dict:
    """Distance of the surface's vertices to the nearest node of the mesh's boundary, voxels."""
    nodes = mesh.points[np.unique(boundary_faces(mesh))]
    away, _ = cKDTree(nodes).query(surface.points)
    return {
        "surface_distance_p95": float(np.percentile(away, 95)),
        "surface_distance_max": float(away.max()),
    }


def report(figures: dict, options: dict) -> None:
    """Say what was made; warn when over 10 % fell out, MeshError when too much did."""
    kept = figures["kept_fraction"]
    log.info(
        "%d tets, %d nodes, mean volume %.3f voxel^3, least dihedral angle %.1f degrees, "
        "%.1f %% kept",
        figures["cells"],
        figures["nodes"],
        figures["mean_volume"],
        figures["min_dihedral"],
        100 * kept,
    )
    if kept < options["min_kept"]:
        raise MeshError(
            f"the largest of {figures['pieces']} pieces holds {kept:.1%} of the mesh (at "
            f"least {options['min_kept']:.0%}, mesh.min_kept): struts are thinner than "
            "the mesh; lower mesh.size"
        )
    if kept < 0.9:
        log.warning(
            "WARNING: %.0f %% of the mesh is in smaller pieces and falls out; lower mesh.size",
            100 * (1 - kept),
        )
