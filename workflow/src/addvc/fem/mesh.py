"""The one mesh type, what can be measured on it, and the checks every mesh must pass."""

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from addvc.errors import MeshError
from addvc.fem.elements import gauss_hex, gauss_tet, hex_q1, tet_p1

TET_FACES = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])
TET_EDGES = np.array([[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]])
HEX_FACES = np.array(
    [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]
)


@dataclass(frozen=True, eq=False)
class Mesh:
    """Points (n, 3) float64 in voxels; cells (m, 4) tetrahedra or (m, 8) hexahedra, int32."""

    points: np.ndarray
    cells: np.ndarray

    def __post_init__(self):
        object.__setattr__(self, "points", np.ascontiguousarray(self.points, dtype=np.float64))
        object.__setattr__(self, "cells", np.ascontiguousarray(self.cells, dtype=np.int32))
        if self.cells.ndim != 2 or self.cells.shape[1] not in (4, 8):
            raise MeshError(f"cells of shape {self.cells.shape}; expected (m, 4) or (m, 8)")

    @property
    def is_tet(self) -> bool:
        return self.cells.shape[1] == 4


def physical_gradients(mesh: Mesh) -> tuple[np.ndarray, np.ndarray]:
    """dN (m, Q, a, 3) in 1/voxel and weights w |J| (m, Q): one point a tet, 2x2x2 a hex."""
    xi, weights = gauss_tet(1) if mesh.is_tet else gauss_hex()
    _, slopes = (tet_p1 if mesh.is_tet else hex_q1)(xi)
    jacobian = np.einsum("qaj,eai->eqij", slopes, mesh.points[mesh.cells])
    gradients = np.einsum("qaj,eqji->eqai", slopes, np.linalg.inv(jacobian))
    return gradients, weights * np.linalg.det(jacobian)


def inverted_share(mesh: Mesh, u: np.ndarray) -> float:
    """Share of the cells that a displacement u (n, 3), voxels, turns inside out."""
    return float((cell_volumes(Mesh(mesh.points + u, mesh.cells)) <= 0).mean())


def cell_volumes(mesh: Mesh) -> np.ndarray:
    """Signed volume of each cell (m,), voxel^3; negative where the cell is inverted."""
    if not mesh.is_tet:
        return physical_gradients(mesh)[1].sum(axis=1)
    corner = mesh.points[mesh.cells]
    edges = corner[:, 1:] - corner[:, :1]
    return np.einsum("ei,ei->e", edges[:, 0], np.cross(edges[:, 1], edges[:, 2])) / 6


def nodal_volumes(mesh: Mesh) -> np.ndarray:
    """Volume (n,) of the solid around each node, voxels^3: a fourth of each of its tetrahedra."""
    volume = np.abs(cell_volumes(mesh)) / 4
    return np.bincount(mesh.cells.ravel(), np.repeat(volume, 4), len(mesh.points))


def mean_edge_length(mesh: Mesh) -> float:
    """Mean length of the distinct edges of a tetrahedral mesh, voxels (what Table 2 calls size)."""
    edges = np.unique(np.sort(mesh.cells[:, TET_EDGES].reshape(-1, 2), axis=1), axis=0)
    return float(np.linalg.norm(np.diff(mesh.points[edges], axis=1), axis=2).mean())


def dihedral_range(mesh: Mesh) -> tuple[np.ndarray, np.ndarray]:
    """Smallest and largest dihedral angle of each tetrahedron, degrees, (m,) each."""
    corner = mesh.points[mesh.cells]
    triangle = corner[:, TET_FACES]  # (m, 4, 3, 3)
    normal = np.cross(triangle[:, :, 1] - triangle[:, :, 0], triangle[:, :, 2] - triangle[:, :, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=2, keepdims=True), 1e-300)
    cosine = -np.einsum("efi,egi->efg", normal, normal)[:, TET_EDGES[:, 0], TET_EDGES[:, 1]]
    angle = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
    return angle.min(axis=1), angle.max(axis=1)


def boundary_faces(mesh: Mesh) -> np.ndarray:
    """Faces that belong to one cell only, (f, 3) or (f, 4), wound outwards."""
    return outer_faces(mesh)[0]


def outer_faces(mesh: Mesh, keep: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Boundary faces (f, 3 | 4) of the cells where `keep` (m,) is true, and the cell (f,) of each."""
    chosen = np.arange(len(mesh.cells)) if keep is None else np.flatnonzero(keep)
    table = TET_FACES if mesh.is_tet else HEX_FACES
    faces = mesh.cells[chosen][:, table].reshape(-1, table.shape[1])
    order = np.sort(faces, axis=1)[:, :3].astype(np.int64)  # three corners tell faces apart
    n = len(mesh.points)
    _, key = np.unique(order[:, 0] * n + order[:, 1], return_inverse=True)
    _, first, count = np.unique(
        key.astype(np.int64) * n + order[:, 2], return_index=True, return_counts=True
    )
    outer = np.sort(first[count == 1])
    return faces[outer], np.repeat(chosen, len(table))[outer]


def face_components(mesh: Mesh) -> np.ndarray:
    """Label (m,) of the face-connected component of each tetrahedron, 0 for the largest."""
    faces = np.sort(mesh.cells[:, TET_FACES].reshape(-1, 3), axis=1)
    order = np.lexsort(faces.T)
    same = (np.diff(faces[order], axis=0) == 0).all(axis=1)
    owner = order // 4
    pairs = owner[:-1][same], owner[1:][same]
    graph = sparse.coo_matrix((np.ones(same.sum()), pairs), shape=(len(mesh.cells),) * 2)
    count, label = connected_components(graph, directed=False)
    volume = np.bincount(label, weights=np.abs(cell_volumes(mesh)), minlength=count)
    rank = np.empty(count, dtype=int)
    rank[np.argsort(-volume, kind="stable")] = np.arange(count)
    return rank[label]


def submesh(mesh: Mesh, keep: np.ndarray) -> Mesh:
    """The cells where `keep` (m,) is true, and the points they use."""
    cells = mesh.cells[keep]
    used, renumbered = np.unique(cells, return_inverse=True)
    return Mesh(mesh.points[used], renumbered.reshape(cells.shape))


def check_mesh(mesh: Mesh, name: str, min_dihedral: float = 0.0) -> dict:
    """Figures of a mesh that may be used, lengths in voxels, angles in degrees. Raises MeshError where
    it has no cells, or they are inverted, flat, loose, or sharper than `min_dihedral`."""
    volume = cell_volumes(mesh)
    refuse_volumes(volume, name)
    figures = {
        "nodes": len(mesh.points),
        "cells": len(mesh.cells),
        "volume": float(volume.sum()),
        "mean_volume": float(volume.mean()),
    }
    if not mesh.is_tet:
        return figures
    smallest, largest = dihedral_range(mesh)
    refuse_loose(mesh, name)
    refuse_sharp(smallest, name, min_dihedral)
    return figures | {
        "components": 1,
        "mean_edge": mean_edge_length(mesh),
        "min_dihedral": float(smallest.min()),
        "min_dihedral_p01": float(np.percentile(smallest, 1)),
        "max_dihedral": float(largest.max()),
    }


def refuse_volumes(volume: np.ndarray, name: str) -> None:
    """Raises MeshError where there is no cell, or a volume (m,) is not positive."""
    if len(volume) == 0:
        raise MeshError(f"{name}: no cells; the region holds no solid: widen it")
    if (volume <= 0).any():
        raise MeshError(
            f"{name}: {(volume <= 0).sum()} of {len(volume)} cells are inverted or flat (smallest "
            f"volume {volume.min():.2e} voxel^3, must be above 0); change mesh.size or meso.sizes"
        )


def refuse_loose(mesh: Mesh, name: str) -> None:
    """Raises MeshError where a mesh is not one piece by the faces of its cells."""
    loose = int(face_components(mesh).max())
    if loose:
        raise MeshError(
            f"{name}: {loose} pieces are not attached by a face to the largest one "
            "(limit 0); keep the largest component only"
        )


def refuse_sharp(smallest: np.ndarray, name: str, limit: float) -> None:
    """Raises MeshError where the smallest dihedral angle of a tetrahedron (m,) is below the limit,
    degrees."""
    if smallest.min() < limit:
        raise MeshError(
            f"{name}: {(smallest < limit).sum()} of {len(smallest)} tetrahedra have a dihedral "
            f"angle below {limit} degrees (smallest {smallest.min():.2g}); change "
            "mesh.size or meso.sizes, or lower mesh.min_dihedral"
        )


def oriented(mesh: Mesh) -> Mesh:
    """The same tetrahedra, each with a positive volume (corners 2 and 3 swapped where needed)."""
    cells = mesh.cells.copy()
    wrong = cell_volumes(mesh) < 0
    cells[wrong] = cells[wrong][:, [0, 1, 3, 2]]
    return Mesh(mesh.points, cells)
