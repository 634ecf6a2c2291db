"""How the struts turn: a rotation for each cell of a mesh, from a displacement."""

import numba as nb
import numpy as np
from scipy import sparse

from addvc.fem.mesh import Mesh, cell_volumes, physical_gradients


def deformation_gradient(mesh: Mesh, u: np.ndarray) -> np.ndarray:
    """F = 1 + du/dX (m, 3, 3) of each tetrahedron for u (n, 3) in voxels."""
    gradients, _ = physical_gradients(mesh)
    return np.eye(3) + np.einsum("eai,eaj->eij", u[mesh.cells], gradients[:, 0])


@nb.njit(inline="always")
def _cofactors(x, out):
    """The cofactors of x (3, 3), det(x) x^-T, into `out`; returns det(x)."""
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        out[i, 0] = x[j, 1] * x[k, 2] - x[j, 2] * x[k, 1]
        out[i, 1] = x[j, 2] * x[k, 0] - x[j, 0] * x[k, 2]
        out[i, 2] = x[j, 0] * x[k, 1] - x[j, 1] * x[k, 0]
    return x[0, 0] * out[0, 0] + x[0, 1] * out[0, 1] + x[0, 2] * out[0, 2]


@nb.njit(parallel=True, cache=True)
def nearest_rotation(matrices):
    """The rotations (m, 3, 3) nearest to matrices (m, 3, 3): the polar factor, of determinant +1.

    By Newton's iteration X <- (X + X^-T) / 2 [Higham 1986]; by singular values where a matrix is
    inverted or nearly flat."""
    out = np.empty_like(matrices)
    for e in nb.prange(matrices.shape[0]):
        x, cofactors = matrices[e].copy(), np.empty((3, 3))
        size = np.sqrt(np.sum(x * x) / 3)
        if _cofactors(x, cofactors) < 1e-3 * size**3:
            left, _, right = np.linalg.svd(x)
            if np.linalg.det(left) * np.linalg.det(right) < 0:
                left[:, 2] *= -1
            out[e] = left @ right
            continue
        for _ in range(50):
            det, change = _cofactors(x, cofactors), 0.0
            for i in range(3):
                for j in range(3):
                    following = (x[i, j] + cofactors[i, j] / det) / 2
                    change = max(change, abs(following - x[i, j]))
                    x[i, j] = following
            if change < 1e-14:
                break
        out[e] = x
    return out


def smooth_rotations(mesh: Mesh, u: np.ndarray, times: int = 4) -> np.ndarray:
    """Rotation (m, 3, 3) of each tetrahedron from u (n, 3), averaged `times` over neighbours.

    An average goes to the nodes, by volume, and back. A tetrahedron of a thin strut turns with the
    noise; its neighbourhood of some voxels turns with the strut."""
    rotation, to_nodes = nearest_rotation(deformation_gradient(mesh, u)), nodal_average(mesh)
    flat = rotation.reshape(-1, 9)
    for _ in range(times):
        flat = (to_nodes @ flat)[mesh.cells].mean(axis=1)
    return nearest_rotation(flat.reshape(-1, 3, 3))


def nodal_average(mesh: Mesh) -> sparse.csr_matrix:
    """(n, m): the mean at each node of what its cells have, weighted by their volumes."""
    cells, corners = mesh.cells, mesh.cells.shape[1]
    entries = (
        np.repeat(cell_volumes(mesh), corners),
        (cells.ravel(), np.arange(cells.size) // corners),
    )
    sums = sparse.csr_matrix(entries, shape=(len(mesh.points), len(cells)))
    return sparse.diags(1 / np.asarray(sums.sum(axis=1)).ravel()) @ sums


def angles(rotation: np.ndarray) -> np.ndarray:
    """Angle (...,) of rotations (..., 3, 3), radians."""
    trace = np.trace(rotation, axis1=-2, axis2=-1)
    return np.arccos(np.clip((trace - 1) / 2, -1, 1))
