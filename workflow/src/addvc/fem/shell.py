"""Quadrature of a strut and its shell: Gauss points inside, void voxel centres around.

The blurred edge of a strut has two flanks. Gauss points see the inner one; the centres of the void
voxels within a voxel or so of the surface see the outer one, which doubles what is known of a thin
strut's position. A shell point is carried by the tetrahedron of the nearest boundary face: linear
extrapolation, or the displacement of the nearest surface point where the tetrahedron is too small
for its size to say anything that far out.
"""

from pathlib import Path

import h5py
import numba as nb
import numpy as np
from scipy.spatial import cKDTree

from addvc.fem.mesh import Mesh, outer_faces
from addvc.fem.quadrature import Quadrature, barycentric, voxel_owner
from addvc.images.files import atomic_path

FARTHEST = 3.0  # largest barycentric coordinate that is extrapolated
NEIGHBOURS = 16  # faces by their centres, among which the nearest face is sought


def shell_points(mesh: Mesh, grey: np.ndarray, gamma: float, width: float = 1.0) -> Quadrature:
    """Voxel centres within `width` voxels outside of a tetrahedral mesh, weight 1 (voxel^3).

    `grey` (nx, ny, nz): a voxel at or above `gamma` is solid that the mesh leaves out (a platen, the
    other side of a cut), and is no point of the shell. May be empty."""
    faces, owner = outer_faces(mesh)
    points = void_near(mesh, grey, gamma, width)
    triangles = mesh.points[faces]
    centres = cKDTree(triangles.mean(axis=1))
    ranks = np.arange(1, min(NEIGHBOURS, len(faces)) + 1)
    candidates = centres.query(points, k=ranks)[1]
    face, foot = nearest_face(points, triangles, candidates)
    near = np.linalg.norm(points - foot, axis=1) <= width
    points, cell, foot = points[near], owner[face[near]], foot[near]
    shape = barycentric(mesh, cell, points)
    far = np.abs(shape).max(axis=1, initial=0) > FARTHEST
    if far.any():
        shape[far] = barycentric(mesh, cell[far], foot[far])
    return Quadrature(cell.astype(np.int32), shape, points, np.ones(len(points)))


def void_near(mesh: Mesh, grey: np.ndarray, gamma: float, width: float) -> np.ndarray:
    """Centres (Q, 3) of voxels below `gamma`, in no tetrahedron, near a node or centre of a face."""
    outside = voxel_owner(mesh.points, mesh.cells, np.array(grey.shape, dtype=np.int64)) < 0
    low = np.maximum(np.floor(mesh.points.min(axis=0) - width), 0).astype(int)
    high = np.ceil(mesh.points.max(axis=0) + width).astype(int) + 1
    box = tuple(slice(a, b) for a, b in zip(low, high, strict=True))
    points = np.argwhere(outside[box] & (grey[box] < gamma)) + low.astype(float)
    faces, _ = outer_faces(mesh)
    corner = mesh.points[faces]
    centre = corner.mean(axis=1)
    reach = width + np.linalg.norm(corner - centre[:, None], axis=2).max()
    away, _ = cKDTree(centre).query(points, distance_upper_bound=reach)
    return points[np.isfinite(away)]


@nb.njit(parallel=True, cache=True)
def nearest_face(points, triangles, candidates):
    """Nearest of the candidate triangles (Q, k) to each point (Q, 3), and its nearest point there."""
    n = points.shape[0]
    face = np.zeros(n, np.int64)
    foot = np.zeros((n, 3))
    for q in nb.prange(n):
        best = np.inf
        for c in range(candidates.shape[1]):
            triangle = triangles[candidates[q, c]]
            near = nearest_on_triangle(points[q], triangle[0], triangle[1], triangle[2])
            away = np.sum((points[q] - near) ** 2)
            if away < best:
                best, face[q] = away, candidates[q, c]
                foot[q] = near
    return face, foot


@nb.njit(cache=True)
def nearest_on_triangle(p, a, b, c):
    """Nearest point of triangle a, b, c to p: by the region p is in [Ericson 2005, 5.1.5]."""
    ab, ac, ap = b - a, c - a, p - a
    d1, d2 = np.sum(ab * ap), np.sum(ac * ap)
    if d1 <= 0.0 and d2 <= 0.0:
        return a
    bp, cp = p - b, p - c
    d3, d4 = np.sum(ab * bp), np.sum(ac * bp)
    if d3 >= 0.0 and d4 <= d3:
        return b
    d5, d6 = np.sum(ab * cp), np.sum(ac * cp)
    if d6 >= 0.0 and d5 <= d6:
        return c
    vc = d1 * d4 - d3 * d2
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        return a + d1 / (d1 - d3) * ab
    vb = d5 * d2 - d1 * d6
    if vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        return a + d2 / (d2 - d6) * ac
    va = d3 * d6 - d5 * d4
    if va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        return b + (d4 - d3) / (d4 - d3 + d5 - d6) * (c - b)
    total = va + vb + vc
    return a + vb / total * ab + vc / total * ac


def joined(first: Quadrature, second: Quadrature) -> Quadrature:
    """The points of both, in this order."""
    parts = (
        np.concatenate([getattr(first, name), getattr(second, name)])
        for name in ("cell", "shape", "points", "weight")
    )
    return Quadrature(*parts)


def save_quadrature(path: str | Path, quadrature: Quadrature) -> None:
    """HDF5: cell, shape, points (voxels) and weight (voxel^3)."""
    with atomic_path(path) as temporary, h5py.File(temporary, "w") as file:
        for name in ("cell", "shape", "points", "weight"):
            file[name] = getattr(quadrature, name)


def load_quadrature(path: str | Path) -> Quadrature:
    """What `save_quadrature` wrote."""
    with h5py.File(path) as file:
        return Quadrature(*(file[name][:] for name in ("cell", "shape", "points", "weight")))
