"""Appendix A: the displacement of one mesh at the nodes of another, as a sparse matrix.

The tetrahedron of a point is sought among those whose centroids are nearest (a KD-tree), by
barycentric coordinates (Eq. A1). A point outside the mesh is extrapolated from the best candidate,
the one whose smallest barycentric coordinate is largest, and is counted.
"""

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from addvc.fem.mesh import Mesh
from addvc.fem.operators import laplacian
from addvc.fem.quadrature import barycentric, locate_in_lattice

CANDIDATES = 24

HOLD = 1e-6
"""Weight of the Laplacian beside the mass matrix: it holds nodes with no solid around them."""


def locate(mesh: Mesh, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Tetrahedron (Q,) of each point (Q, 3), and its barycentric coordinates (Q, 4)."""
    corner = mesh.points[mesh.cells]
    centre = corner.mean(axis=1)
    reach = np.linalg.norm(corner - centre[:, None], axis=2).max()  # no cell is larger
    tree = cKDTree(centre)
    cell = tree.query(points)[1]
    shape = barycentric(mesh, cell, points)
    best = shape.min(axis=1)
    todo, count = np.flatnonzero(best < -1e-9), CANDIDATES
    while len(todo):
        count = min(count, len(centre))
        away, near = tree.query(points[todo], k=count)
        away, near = away.reshape(len(todo), count), near.reshape(len(todo), count)
        for column in near.T:
            rows = np.flatnonzero(best[todo] < -1e-9)
            trial = barycentric(mesh, column[rows], points[todo[rows]])
            better = trial.min(axis=1) > best[todo[rows]]
            at, rows = todo[rows[better]], rows[better]
            cell[at], shape[at], best[at] = column[rows], trial[better], trial[better].min(axis=1)
        farther = (away[:, -1] < reach) & (count < len(centre))
        todo = todo[(best[todo] < -1e-9) & farther]
        count *= 4
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


class Projection:
    """Back to a mesh: the field of it that is nearest to displacements at points (Q, 3) with weights
    (Q,), in the sense of least squares. `at_points` (Q, n) goes from its nodes to the points.

    Nodes whose cells have no point carry on smoothly what is around them or, of a `change`, are zero."""

    def __init__(
        self,
        mesh: Mesh,
        points: np.ndarray,
        weight: np.ndarray,
        hold: float = HOLD,
        change: bool = False,
    ):
        from sksparse.cholmod import cholesky

        self.at_points, _ = transfer_matrix(mesh, points)
        self._free = self.at_points.getnnz(axis=0) > 0 if change else slice(None)
        self._weighted = (self.at_points.T @ sparse.diags(weight)).tocsr()[self._free]
        mass = self._weighted @ self.at_points[:, self._free]
        stiff = laplacian(mesh).tocsr()[self._free][:, self._free]
        scale = hold * mass.diagonal().mean() / stiff.diagonal().mean()
        self._solve = cholesky((mass + scale * stiff).tocsc())

    def nodal(self, u: np.ndarray) -> np.ndarray:
        """u (Q, 3) -> (n, 3) at the nodes."""
        found = np.zeros((self.at_points.shape[1], 3))
        found[self._free] = self._solve(self._weighted @ u)
        return found
