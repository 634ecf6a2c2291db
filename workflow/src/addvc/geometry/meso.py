"""Fig. 5: meso meshes of the whole specimen, a cylinder or a box between the platens.

A triangulated section (rings, or a grid) is extruded in layers, and each prism cut into three
tetrahedra. pytetwild gave good meshes too, but not the same one twice: its optimiser draws from the
system's random device (76 to 85 nodes for one cylinder in four runs), which no seed reaches, and the
same input must give the same result.
"""

from dataclasses import replace

import numpy as np
from scipy.spatial import Delaunay

from addvc.errors import MeshError
from addvc.fem.mesh import Mesh, mean_edge_length, oriented
from addvc.images.specimen import Specimen

TRIALS = (0.85, 0.9, 0.8, 0.95, 0.75, 1.0, 0.7, 1.05, 0.65, 1.1, 0.6)  # spacing over mean edge
NEAR = 0.03


def disc_section(radius: float, spacing: float) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 2) on rings some `spacing` apart around the origin, and triangles (t, 3).

    The outermost ring is a polygon of the same area as the disc."""
    rings = max(1, round(radius / spacing))
    turn = np.pi / (3 * rings)  # of a side of the outer polygon
    outer = radius * np.sqrt(turn / np.sin(turn))
    points = [np.zeros((1, 2))]
    for ring in range(1, rings + 1):
        angle = 2 * np.pi * (np.arange(6 * ring) + 0.5 * (ring % 2)) / (6 * ring)
        points.append(outer * ring / rings * np.column_stack([np.cos(angle), np.sin(angle)]))
    points = np.vstack(points)
    return points, Delaunay(points).simplices


def box_section(
    bounds: tuple[tuple[float, float], tuple[float, float]], spacing: float
) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 2) of a grid over a rectangle, and triangles (t, 3), diagonals alternating."""
    counts = [max(1, round((high - low) / spacing)) for low, high in bounds]
    lines = [np.linspace(*pair, count + 1) for pair, count in zip(bounds, counts, strict=True)]
    points = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 2)
    number = np.arange(len(points)).reshape(counts[0] + 1, counts[1] + 1)
    a, b, c, d = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    odd = (np.indices(a.shape).sum(axis=0) % 2 == 1).ravel()
    a, b, c, d = (corner.ravel() for corner in (a, b, c, d))
    first = np.where(odd[:, None], np.column_stack([a, b, d]), np.column_stack([a, b, c]))
    second = np.where(odd[:, None], np.column_stack([b, c, d]), np.column_stack([a, c, d]))
    return points, np.vstack([first, second])


def extruded(section: np.ndarray, triangles: np.ndarray, levels: np.ndarray, axis: int) -> Mesh:
    """Tetrahedra between copies of a section (n, 2) at coordinates `levels` along `axis`.

    Diagonals leave from the corner with the smaller number, so that neighbours agree."""
    count = len(section)
    points = np.insert(np.tile(section, (len(levels), 1)), axis, np.repeat(levels, count), axis=1)
    a, b, c = np.sort(triangles, axis=1).T
    base = np.arange(len(levels) - 1)[:, None] * count
    a, b, c = ((base + corner).ravel() for corner in (a, b, c))
    above = [corner + count for corner in (a, b, c)]
    cells = [(a, b, c, above[2]), (a, b, above[1], above[2]), (a, *above)]
    return oriented(Mesh(points, np.vstack([np.column_stack(cell) for cell in cells])))


def specimen_mesh(specimen: Specimen, spacing: float) -> Mesh:
    """Tetrahedra of a specimen with points some `spacing` voxels apart."""
    if specimen.kind == "cylinder":
        section, triangles = disc_section(specimen.radius, spacing)
        section = section + np.asarray(specimen.centre)
    else:
        section, triangles = box_section(specimen.bounds, spacing)
    layers = max(1, round((specimen.high - specimen.low) / spacing))
    levels = np.linspace(specimen.low, specimen.high, layers + 1)
    return extruded(section, triangles, levels, specimen.axis)


def meso_mesh(specimen: Specimen, size: float, margin: float = 0.0) -> Mesh:
    """Tetrahedra of the specimen whose mean edge is nearest to `size` voxels (Table 2's size), its
    end faces `margin` voxels away from the platens.

    Raises MeshError when no mesh comes within 35 % of it: the specimen is too small."""
    height = specimen.high - specimen.low
    if 2 * margin >= height:
        raise MeshError(
            f"the specimen is {height:.1f} voxels high, and meso.margin {margin:g} (less than "
            f"{height / 2:.1f}) leaves nothing of it; lower meso.margin"
        )
    specimen = replace(specimen, low=specimen.low + margin, high=specimen.high - margin)
    best, edge = None, np.inf
    for share in TRIALS:
        mesh = specimen_mesh(specimen, share * size)
        found = mean_edge_length(mesh)
        if abs(found - size) < abs(edge - size):
            best, edge = mesh, found
        if abs(edge - size) < NEAR * size:
            break
    if abs(edge - size) > 0.35 * size:
        raise MeshError(
            f"no mesh of the specimen has edges of {size:.1f} voxels (nearest {edge:.1f}, at most 35 % "
            "off): the specimen is too small for it; give smaller meso.sizes"
        )
    return best
