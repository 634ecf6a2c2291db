"""Where a result is in doubt: the grey residual around a node against the noise of the images."""

from dataclasses import replace

import numpy as np

from addvc.correlation.metric import Reference, residual

LIMIT = 2.7
"""Largest rms residual over the noise of a difference of two images, as their splines have it. With it
and `validity.MOST`, on the twin (seed 2417), micro DVC at 28.5 %: of struts in error by over 1 voxel
all are caught but one that lies on another strut (`strut_table.ASTRAY`), from 2.0 to 3.0; of the others
2.4 % are flagged, 2.9 % at 2.0, 2.0 % at 3.0."""

AVERAGES = 6
"""Of residuals over neighbours: some three voxels of a mesh of 1.2."""


def residual_limit(noise: float) -> float:
    """Largest residual (rms around a node) of a node that is right; `noise`: of the spline of one image,
    both in grey levels."""
    return LIMIT * np.sqrt(2) * noise


def nodal_square(
    reference: Reference, r: np.ndarray, inside: np.ndarray, times: int = AVERAGES
) -> np.ndarray:
    """Mean r^2 (n,) around each node from residuals (Q,), averaged `times` over neighbours; nan where
    no point is inside of the image."""
    mesh, q = reference.mesh, reference.quadrature
    weight = np.where(inside, q.weight, 0.0)
    sums = np.column_stack([weight * r.astype(float) ** 2, weight])
    cells = np.stack([np.bincount(q.cell, column, len(mesh.cells)) for column in sums.T], axis=1)
    nodes, n = mesh.cells.ravel(), len(mesh.points)
    for step in range(times + 1):
        spread = np.repeat(cells, mesh.cells.shape[1], axis=0)
        nodal = np.stack([np.bincount(nodes, column, n) for column in spread.T], axis=1)
        if step < times:
            share = nodal / np.bincount(nodes, minlength=n)[:, None]
            cells = share[mesh.cells].mean(axis=1)
    known = nodal[:, 1] > 0
    return np.where(known, nodal[:, 0] / np.where(known, nodal[:, 1], 1), np.nan)


def doubtful_nodes(
    reference: Reference, deformed: np.ndarray, u: np.ndarray, limit: float
) -> np.ndarray:
    """(n,) bool: the rms residual around the node under u (n, 3) is above the limit, or unknown."""
    r, inside = residual(reference, deformed, u)
    return ~(np.sqrt(nodal_square(reference, r, inside)) <= limit)


def without(reference: Reference, doubtful: np.ndarray) -> Reference:
    """The same points, those in cells with a doubtful node (n,) of weight zero."""
    q = reference.quadrature
    kept = ~doubtful[reference.mesh.cells].any(axis=1)
    return replace(reference, quadrature=replace(q, weight=q.weight * kept[q.cell]))
