"""Eq. 6, 7: a displacement rescaled along x, y and z by three Gauss-Newton unknowns."""

from collections.abc import Callable

import numpy as np
from scipy import sparse


def scaling_basis(w: np.ndarray) -> np.ndarray:
    """Eq. 7: R (3 n, 3), column d holding component d of w (n, 3) and zeros elsewhere.

    A component that is zero everywhere gets a rigid translation in its place, as it has no scale."""
    basis = np.zeros((*w.shape, 3))
    for d in range(3):
        basis[:, d, d] = w[:, d] if np.abs(w[:, d]).max() > 1e-9 else 1.0
    return basis.reshape(-1, 3)


def reduced_solve(
    hessian: sparse.spmatrix, basis: np.ndarray
) -> Callable[[np.ndarray], np.ndarray]:
    """Eq. 6: b (3 n,) -> d (3 n,) = R alpha with R^T H R alpha = R^T b, as a function to hand to
    Gauss-Newton; H (3 n, 3 n), R (3 n, 3) the basis."""
    small = basis.T @ (hessian @ basis)
    return lambda b: basis @ np.linalg.lstsq(small, basis.T @ b, rcond=1e-12)[0]


def scale_factors(u: np.ndarray, w: np.ndarray) -> list[float]:
    """The three factors by which u (n, 3) = w scaled: the least squares ratio by component.

    One for a component that is zero in w, which has no scale."""
    size = [w[:, d] @ w[:, d] for d in range(3)]
    return [float(u[:, d] @ w[:, d] / size[d]) if size[d] > 0 else 1.0 for d in range(3)]
