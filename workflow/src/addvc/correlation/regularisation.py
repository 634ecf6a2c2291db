"""Eq. 9 to 11: what is added to the functional, weighted by cut-off lengths.

Every term is normalised on a shear wave v of period T (`shear_wave`), S(v) being its quadratic form
v^T H v, so that a weight is (cut-off / T)**order: order 4 where an operator's norm is squared (Eq.
10), order 2 where it is used once (Eq. 9, an elastic energy). Multiplied through by S(v), the
functional reads S(u) + u^T M u, and it is M that these functions return.

In a foam ||D_K K v||^2 is dominated by the nodes of the free surface, so that it falls as T**-2
rather than T**-4 below a period of some five cells: the cut-off then depends on T, which is why T
is a value of the configuration and is reported with l_K.
"""

import numpy as np
from scipy import sparse

from addvc.fem.mesh import Mesh
from addvc.fem.operators import laplacian, stiffness, vectorised


def shear_wave(points: np.ndarray, axis: int, period: float) -> np.ndarray:
    """The paper's trial field v = cos(2 pi y / T) e_y, flattened (3 n,); y is the loading axis."""
    v = np.zeros_like(points)
    v[:, axis] = np.cos(2 * np.pi * points[:, axis] / period)
    return v.ravel()


def tikhonov_weight(cutoff: float, period: float, order: int = 4) -> float:
    """Eq. 11: lambda = (l / T)**4; order 2 for a quadratic form of a second-order operator."""
    return (cutoff / period) ** order


def quadratic(matrix: sparse.spmatrix, v: np.ndarray) -> float:
    """v^T A v."""
    return float(v @ (matrix @ v))


def diffusion(
    mesh: Mesh, hessian: sparse.spmatrix, cutoff: float, period: float, axis: int
) -> sparse.spmatrix:
    """Eq. 9 with T = L: M = lambda S(v) / (v^T L v) L, lambda = (l_L / T)**2."""
    v = shear_wave(mesh.points, axis, period)
    operator = vectorised(laplacian(mesh))
    weight = tikhonov_weight(cutoff, period, order=2)
    return operator * (weight * quadratic(hessian, v) / quadratic(operator, v))


def elastic_weight(
    mesh: Mesh,
    hessian: sparse.spmatrix,
    stiffness_: sparse.spmatrix,
    cutoff: float,
    period: float,
    axis: int,
) -> float:
    """c of the elastic energy c u^T K u: lambda_E S(v) / (v^T K v), lambda_E = (l_E / T)**2."""
    v = shear_wave(mesh.points, axis, period)
    weight = tikhonov_weight(cutoff, period, order=2)
    return weight * quadratic(hessian, v) / quadratic(stiffness_, v)


def gap(operator: sparse.spmatrix, selected: np.ndarray) -> sparse.csr_matrix:
    """(D A)^T (D A) for the rows of the selected nodes (n,) bool: a squared norm as a matrix."""
    rows = operator.tocsr()[np.repeat(selected, 3)]
    return (rows.T @ rows).tocsr()


def equilibrium_gap(
    mesh: Mesh,
    hessian: sparse.spmatrix,
    penalised: np.ndarray,
    l_k: float,
    l_l: float,
    period: float,
    nu: float,
    axis: int,
) -> tuple[sparse.csr_matrix, dict]:
    """Eq. 10: M = c1 K^T D_K K + c2 L^T D_L L, and its weights c1, c2.

    D_L selects the `penalised` nodes (n,) bool (cut or loaded), D_K all others (bulk, free)."""
    v = shear_wave(mesh.points, axis, period)
    trial = quadratic(hessian, v)
    matrix, weights = sparse.csr_matrix(hessian.shape), {"S_v": trial}
    terms = (
        ("c1", stiffness(mesh, nu), ~penalised, l_k),
        ("c2", vectorised(laplacian(mesh)), penalised, l_l),
    )
    for name, operator, selected, cutoff in terms:
        if not selected.any():
            weights[name] = 0.0
            continue
        square = gap(operator, selected)
        weights[name] = tikhonov_weight(cutoff, period) * trial / quadratic(square, v)
        matrix = matrix + weights[name] * square
    return matrix, weights
