"""Eq. 2, 3, 5: the grey-level functional S(u), its modified gradient and its modified Hessian."""

from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from addvc.fem.assembly import Pattern, block_matrix, scatter_dyads, scatter_vectors
from addvc.fem.mesh import Mesh
from addvc.fem.quadrature import Quadrature, interpolate
from addvc.images.spline import DEGREE, spline_value, spline_value_gradient


@dataclass(frozen=True, eq=False)
class Reference:
    """I_r on the quadrature of a mesh: grey levels (Q,), gradient (Q, 3) per voxel, inside (Q,);
    degree of the splines, which is that of I_d too.

    Points outside of I_r itself have neither grey level nor gradient."""

    mesh: Mesh
    quadrature: Quadrature
    grey: np.ndarray
    gradient: np.ndarray
    inside: np.ndarray
    degree: int = DEGREE


def reference_on(
    mesh: Mesh, quadrature: Quadrature, coefficients: np.ndarray, degree: int = DEGREE
) -> Reference:
    """Sample the spline of I_r (Eq. 4) at the points of a quadrature."""
    grey, gradient, inside = spline_value_gradient(coefficients, quadrature.points, degree)
    return Reference(mesh, quadrature, grey, gradient, inside, degree)


def turned(reference: Reference, rotation: np.ndarray) -> Reference:
    """The gradient of I_r carried by cells that turn, R grad I_r: near x + u it is that of I_d.

    rotation (m, 3, 3) of each cell."""
    gradient = np.einsum("qij,qj->qi", rotation[reference.quadrature.cell], reference.gradient)
    return replace(reference, gradient=gradient.astype(reference.gradient.dtype))


def geman_mcclure(r: np.ndarray, scale: float) -> np.ndarray:
    """Weights (Q,) of iteratively reweighted least squares for rho(r) = r^2 / (1 + (r / s)^2)
    [Geman & McClure 1987]: 1 for small residuals, 1/4 at r = s, nothing far beyond."""
    return 1 / (1 + (r / scale) ** 2) ** 2


def robust_square(r: np.ndarray, scale: float | None) -> np.ndarray:
    """rho(r) of `geman_mcclure` (Q,), float64; r^2 without a scale."""
    square = r.astype(float) ** 2
    return square if scale is None else square / (1 + square / scale**2)


def seen_square(
    reference: Reference, r: np.ndarray, inside: np.ndarray, scale: float | None
) -> np.ndarray:
    """rho(r) (Q,) where the residual is known, inside (Q,); elsewhere what a point on a wrong strut
    costs, so that nothing is gained by leaving the image."""
    worst = scale**2 if scale is not None else np.ptp(reference.grey) ** 2
    return np.where(inside, robust_square(r, scale), worst)


def residual(
    reference: Reference, deformed: np.ndarray, u: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Eq. 5: r = I_r(x) - I_d(x + u(x)) (Q,) and inside (Q,); r = 0 where x is not
    in I_r or x + u has left I_d."""
    quadrature = reference.quadrature
    at_points = interpolate(reference.mesh.cells, quadrature.cell, quadrature.shape, u)
    return residual_at(reference, deformed, at_points)


def residual_at(
    reference: Reference, deformed: np.ndarray, u: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The same for displacements u (Q, 3) given at the points themselves."""
    grey, inside = spline_value(deformed, reference.quadrature.points + u, reference.degree)
    inside &= reference.inside
    return np.where(inside, reference.grey - grey, np.float32(0)), inside


def hessian(reference: Reference, pattern: Pattern) -> sparse.bsr_matrix:
    """H_S of Eq. 3 (3 n, 3 n), from the gradient of I_r only: constant through the iterations."""
    q = reference.quadrature
    blocks = scatter_dyads(
        pattern.slot, q.cell, q.shape, q.weight, reference.gradient, len(pattern.indices)
    )
    return block_matrix(pattern, blocks)


def right_hand_side(reference: Reference, r: np.ndarray) -> np.ndarray:
    """b = -grad S / 2 of Eq. 3 (3 n,), from residuals r (Q,)."""
    q = reference.quadrature
    vectors = r[:, None] * reference.gradient
    n = len(reference.mesh.points)
    return scatter_vectors(reference.mesh.cells, q.cell, q.shape, q.weight, vectors, n).ravel()


def residual_statistics(r: np.ndarray, inside: np.ndarray, weight: np.ndarray) -> dict:
    """Mean and standard deviation, weighted by weight (Q,), of residuals r (Q,), grey levels, where they
    are known: inside (Q,) bool; nan where none is. `outside`: the number of points dropped."""
    kept, w = r[inside].astype(np.float64), weight[inside]
    if len(kept) == 0:
        return {"mean": float("nan"), "std": float("nan"), "outside": int((~inside).sum())}
    mean = float(np.average(kept, weights=w))
    std = float(np.sqrt(np.average((kept - mean) ** 2, weights=w)))
    return {"mean": mean, "std": std, "outside": int((~inside).sum())}
