"""How the struts turn: a rotation for each cell of a mesh, from a displacement."""

import numba as nb
import numpy as np

from addvc.fem.mesh import Mesh, cell_volumes, physical_gradients


def deformation_gradient(mesh: Mesh, u: np.ndarray) -> np.ndarray:
    """F = 1 + du/dX (m, 3, 3) of each tetrahedron for u (n, 3) in voxels."""
    gradients, _ = physical_gradients(mesh)
    return np.eye(3) + np.einsum("eai,eaj->eij", u[mesh.cells], gradients[:, 0])


@nb.njit(parallel=True, cache=True)
def nearest_rotation(matrices):
    """The rotations (m, 3, 3) nearest to matrices (m, 3, 3): the polar factor, of determinant +1.

    By Newton's iteration X <- (X + X^-T) / 2 [Higham 1986]; by singular values where a matrix is
    inverted or nearly flat."""
    out = np.empty_like(matrices)
    for e in nb.prange(matrices.shape[0]):
        x = matrices[e].copy()
        size = np.sqrt(np.sum(x * x) / 3)
        if np.linalg.det(x) < 1e-3 * size**3:
            left, _, right = np.linalg.svd(x)
            if np.linalg.det(left) * np.linalg.det(right) < 0:
                left[:, 2] *= -1
            out[e] = left @ right
            continue
        for _ in range(50):
            following = (x + np.linalg.inv(x).T) / 2
            change = np.abs(following - x).max()
            x = following
            if change < 1e-14:
                break
        out[e] = x
    return out


def smooth_rotations(mesh: Mesh, u: np.ndarray, times: int = 4) -> np.ndarray:
    """Rotation (m, 3, 3) of each tetrahedron from u (n, 3), averaged `times` over neighbours.

    An average goes to the nodes, by volume, and back. A tetrahedron of a thin strut turns with the
    noise; its neighbourhood of some voxels turns with the strut."""
    rotation, volume = nearest_rotation(deformation_gradient(mesh, u)), cell_volumes(mesh)
    for _ in range(times):
        rotation = nodal_mean(mesh, rotation, volume)[mesh.cells].mean(axis=1)
    return nearest_rotation(rotation)


def nodal_mean(mesh: Mesh, values: np.ndarray, volume: np.ndarray) -> np.ndarray:
    """Mean (n, ...) over the cells of each node of values (m, ...), weighted by volume (m,)."""
    nodes, n = mesh.cells.ravel(), len(mesh.points)
    corners = mesh.cells.shape[1]
    flat = (volume[:, None] * values.reshape(len(values), -1)).repeat(corners, axis=0)
    total = np.bincount(nodes, volume.repeat(corners), n)
    mean = np.stack([np.bincount(nodes, column, n) for column in flat.T], axis=1) / total[:, None]
    return mean.reshape(n, *values.shape[1:])


def angles(rotation: np.ndarray) -> np.ndarray:
    """Angle (...,) of rotations (..., 3, 3), radians."""
    trace = np.trace(rotation, axis1=-2, axis2=-1)
    return np.arccos(np.clip((trace - 1) / 2, -1, 1))
