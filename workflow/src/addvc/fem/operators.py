"""The elastic stiffness K(E = 1, nu) and the Laplacian L of a mesh."""

import numpy as np
from scipy import sparse

from addvc.fem.assembly import (
    Pattern,
    block_matrix,
    node_pattern,
    scalar_matrix,
    scatter_laplacian,
    scatter_stiffness,
)
from addvc.fem.mesh import Mesh, physical_gradients


def lame(nu: float, young: float = 1.0) -> tuple[float, float]:
    """Lame's two moduli of an isotropic solid."""
    return young * nu / ((1 + nu) * (1 - 2 * nu)), young / (2 * (1 + nu))


def stiffness(
    mesh: Mesh,
    nu: float,
    pattern: Pattern | None = None,
    rotation: np.ndarray | None = None,
    modulus: np.ndarray | float = 1.0,
) -> sparse.bsr_matrix:
    """K (3 n, 3 n) with E = `modulus`, of each cell (m,) or of all: symmetric, its null space the six
    rigid motions of the mesh.

    With a rotation (m, 3, 3) of each tetrahedron, K_R: each cell's R K R^T, which for an isotropic
    solid is K of rotated gradients."""
    pattern = pattern or node_pattern(mesh)
    gradients, weights = physical_gradients(mesh)
    if rotation is not None:
        gradients = np.einsum("eij,eqaj->eqai", rotation, gradients)
    weights = weights * np.reshape(modulus, (-1, 1))
    blocks = scatter_stiffness(pattern.slot, gradients, weights, *lame(nu), len(pattern.indices))
    return block_matrix(pattern, blocks)


def laplacian(mesh: Mesh, pattern: Pattern | None = None) -> sparse.csr_matrix:
    """L (n, n), L_ab = int grad N_a . grad N_b: the same for each component of a displacement."""
    pattern = pattern or node_pattern(mesh)
    gradients, weights = physical_gradients(mesh)
    values = scatter_laplacian(pattern.slot, gradients, weights, len(pattern.indices))
    return scalar_matrix(pattern, values)


def vectorised(scalar: sparse.csr_matrix) -> sparse.bsr_matrix:
    """A scalar operator (n, n) applied to each component: (3 n, 3 n)."""
    blocks = scalar.data[:, None, None] * np.eye(3)
    n = scalar.shape[0]
    return sparse.bsr_matrix((blocks, scalar.indices, scalar.indptr), shape=(3 * n, 3 * n))


def strain(mesh: Mesh, u: np.ndarray, finite: bool = False) -> np.ndarray:
    """Strain (m, 3, 3) of each tetrahedron from u (n, 3): small, or Green-Lagrange if `finite`."""
    gradients, _ = physical_gradients(mesh)
    slope = np.einsum("eai,eaj->eij", u[mesh.cells], gradients[:, 0])  # du_i/dx_j
    small = (slope + slope.transpose(0, 2, 1)) / 2
    return small + np.einsum("eki,ekj->eij", slope, slope) / 2 if finite else small


def corotational_load(
    mesh: Mesh, nu: float, rotation: np.ndarray, modulus: np.ndarray | float = 1.0
) -> np.ndarray:
    """f_R = sum R K (R^T X - X) (3 n,), so that K_R u + f_R are the elastic forces of u (E = `modulus`).

    They vanish where each tetrahedron turns by just its rotation (m, 3, 3) [Mueller & Gross 2004]."""
    lam, mu = lame(nu)
    gradients, weights = physical_gradients(mesh)
    small = (rotation + rotation.transpose(0, 2, 1)) / 2 - np.eye(3)
    trace = np.einsum("eii->e", small)
    stress = lam * trace[:, None, None] * np.eye(3) + 2 * mu * small
    turned = np.einsum("e,eij,ejk->eik", weights[:, 0] * modulus, rotation, stress)
    force = np.einsum("eik,eak->eai", turned, gradients[:, 0]).reshape(-1, 3)
    nodes, n = mesh.cells.ravel(), len(mesh.points)
    return np.stack([np.bincount(nodes, column, n) for column in force.T], axis=1).ravel()
