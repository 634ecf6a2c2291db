"""Appendix A: the displacement of one mesh at the nodes of another, as a sparse matrix.

The tetrahedron of a point is sought among those whose centroids are nearest (a KD-tree), by
barycentric coordinates (Eq. A1). A point outside the mesh is extrapolated from the best candidate,
the one whose smallest barycentric coordinate is largest, and is counted.
"""

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from addvc.fem.mesh import Mesh
from addvc.fem.quadrature import barycentric, locate_in_lattice

CANDIDATES = 24


def locate(mesh: Mesh, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Tetrahedron (Q,) of each point (Q, 3), and its barycentric coordinates (Q, 4)."""
    tree = cKDTree(mesh.points[mesh.cells].mean(axis=1))
    count = min(CANDIDATES, len(mesh.cells))
    _, near = tree.query(points, k=count)
    near = near.reshape(len(points), count)
    cell = near[:, 0].copy()
    shape = barycentric(mesh, cell, points)
    best = shape.min(axis=1)
    for candidate in near.T[1:]:
        todo = np.flatnonzero(best < -1e-9)
        if len(todo) == 0:
            break
        trial = barycentric(mesh, candidate[todo], points[todo])
        better = trial.min(axis=1) > best[todo]
        rows = todo[better]
        cell[rows], shape[rows] = candidate[rows], trial[better]
        best[rows] = trial[better].min(axis=1)
    return cell, shape


def transfer_matrix(mesh: Mesh, points: np.ndarray) -> tuple[sparse.csr_matrix, int]:
    """P (Q, n) with u(points) = P u, exact on affine fields, and the number of points outside."""
    cell, shape = locate(mesh, points)
    outside = int((shape.min(axis=1) < -1e-6).sum())
    return interpolation(mesh, cell, shape), outside


def interpolation(mesh: Mesh, cell: np.ndarray, shape: np.ndarray) -> sparse.csr_matrix:
    """Shape functions (Q, a) in cells (Q,) as a matrix (Q, n) from nodes to points."""
    rows = np.repeat(np.arange(len(cell)), shape.shape[1])
    entries = (shape.ravel(), (rows, mesh.cells[cell].ravel()))
    return sparse.csr_matrix(entries, shape=(len(cell), len(mesh.points)))


def lattice_matrix(lines: list[np.ndarray], mesh: Mesh, points: np.ndarray) -> sparse.csr_matrix:
    """The same from a rectilinear hexahedral grid with the given grid lines (extrapolated)."""
    cell, shape = locate_in_lattice(lines, points)
    return interpolation(mesh, cell, shape)
