"""What is rendered: boundaries of meshes, slabs of them, surfaces of segmented images."""

import numpy as np

from addvc.fem.mesh import Mesh
from addvc.geometry.surface import marching_cubes
from addvc.images.levels import bin_mean, to_fine
from addvc.images.specimen import Specimen

MOST_VOXELS = 3e7  # of an image that is rendered as a whole; larger ones are binned


def compact(points: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The points that faces use, the faces renumbered, and the numbers of these points."""
    used, renumbered = np.unique(faces, return_inverse=True)
    return points[used], renumbered.reshape(faces.shape), used


def centroids(mesh: Mesh, u: np.ndarray | None = None) -> np.ndarray:
    """Middle (m, 3) of each cell, displaced by u (n, 3) if given."""
    points = mesh.points if u is None else mesh.points + u
    return points[mesh.cells].mean(axis=1)


def in_box(points: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Which points (n, 3) lie between two corners."""
    return ((points >= low) & (points <= high)).all(axis=1)


def box_corners(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """The eight corners (8, 3) of a box."""
    return np.stack(np.meshgrid(*zip(low, high, strict=True), indexing="ij"), -1).reshape(-1, 3)


def clipped(mesh: Mesh, low, high, **fields: np.ndarray) -> tuple[np.ndarray, np.ndarray, dict]:
    """Surface of the part of a tetrahedral mesh inside a box, cut by planes: points, triangles, and
    `fields`, each (n, ...) of the points or (m, ...) of the cells behind the triangles."""
    import pyvista

    corner = mesh.points[mesh.cells]
    near = ((corner.max(axis=1) >= low) & (corner.min(axis=1) <= high)).all(axis=1)
    if not near.any():
        return np.empty((0, 3)), np.empty((0, 3), int), {k: v[:0] for k, v in fields.items()}
    points, cells, used = compact(mesh.points, mesh.cells[near])
    grid = pyvista.UnstructuredGrid({pyvista.CellType.TETRA: cells}, points)
    for name, values in fields.items():
        on_points = len(values) == len(mesh.points)
        target = grid.point_data if on_points else grid.cell_data
        target[name] = values[used] if on_points else values[near]
    for d in range(3):
        for bound, sign in ((low[d], 1.0), (high[d], -1.0)):
            if grid.n_cells and (sign * (grid.points[:, d] - bound) < 0).any():
                axis = np.eye(3)[d]
                grid = grid.clip(normal=sign * axis, origin=bound * axis, invert=False)
    surface = grid.extract_surface(algorithm="dataset_surface").triangulate()
    found = {name: np.asarray(surface[name]) for name in fields}
    return np.asarray(surface.points, float), surface.faces.reshape(-1, 4)[:, 1:], found


def segmented(volume: np.ndarray, gamma: float, low, high) -> tuple[np.ndarray, np.ndarray]:
    """Closed surface of {grey > gamma} within a box (voxels): points (n, 3), triangles (f, 3).

    Faces of the box that lie between voxels are rounded to voxel centres."""
    start = np.clip(np.ceil(low), 0, np.array(volume.shape) - 1).astype(int)
    stop = np.clip(np.floor(high), start, np.array(volume.shape) - 1).astype(int) + 1
    part = volume[tuple(slice(a, b) for a, b in zip(start, stop, strict=True))]
    if not (part > gamma).any():
        return np.empty((0, 3)), np.empty((0, 3), dtype=np.int32)
    surface = marching_cubes(part, gamma)
    return surface.points + start, surface.faces


def whole_foam(
    volume: np.ndarray, gamma: float, specimen: Specimen, low: float, high: float
) -> tuple[np.ndarray, np.ndarray]:
    """Surface of the foam between two positions on the loading axis, binned when very large."""
    factor = int(np.ceil((volume.size / MOST_VOXELS) ** (1 / 3)))
    coarse = bin_mean(volume, factor) if factor > 1 else volume
    ends = np.zeros(3), np.array(coarse.shape) - 1.0
    for end, value in zip(ends, (low + 1, high - 1), strict=True):
        end[specimen.axis] = (value + 0.5) / factor - 0.5
    points, faces = segmented(coarse, gamma, *ends)
    return to_fine(points, factor), faces


def slab(mesh: Mesh, axis: int, thickness: float) -> tuple[int, float, float]:
    """The slice of Fig. 14: its normal (first axis across the loading axis) and both of its faces,
    in the middle of the mesh."""
    normal = 0 if axis != 0 else 1
    low, high = mesh.points[:, normal].min(), mesh.points[:, normal].max()
    half = min(thickness, high - low) / 2
    return normal, (low + high) / 2 - half, (low + high) / 2 + half


def slab_box(mesh: Mesh, axis: int, thickness: float) -> tuple[np.ndarray, np.ndarray]:
    """Corners of the slice of Fig. 14."""
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    normal, first, last = slab(mesh, axis, thickness)
    low[normal], high[normal] = first, last
    return low, high
