"""What can be trusted: the grey residual around a node or a strut against the image's own noise."""

import numpy as np

from addvc.correlation.metric import Reference
from addvc.fem.mesh import Mesh

LIMIT = 2.0
"""Largest rms residual over the noise of a difference of two images. With it and `MOST`, on the twin
(seed 2417), corotational micro DVC at 28.5 %: every strut in error by over 1 voxel is caught, 1 % of
the others are flagged; at 1.5 both are 2 % worse, at 2.5 nodes in error are missed."""

MOST = 0.7
"""Share of the nodes of a strut, by volume, that must be valid."""

AVERAGES = 6
"""Of residuals over neighbours: some three voxels of a mesh of 1.2."""


def residual_limit(noise: float) -> float:
    """Largest residual (rms around a node) of a node that is right; `noise`: of one image."""
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


def nodal_residual(mesh: Mesh, cell_square: np.ndarray) -> np.ndarray:
    """rms residual (n,) around each node from the mean r^2 of cells (m,); nan where none is known."""
    per_cell = mesh.cells.shape[1]
    square = np.repeat(cell_square, per_cell)
    known, nodes = np.isfinite(square), mesh.cells.ravel()
    total = np.bincount(nodes[known], square[known], len(mesh.points))
    count = np.bincount(nodes[known], minlength=len(mesh.points))
    return np.sqrt(np.where(count > 0, total / np.maximum(count, 1), np.nan))


def valid_nodes(rms: np.ndarray, noise: float) -> np.ndarray:
    """(n,) bool: the residual around the node (n,) is below the limit, and known."""
    return rms <= residual_limit(noise)


def valid_strut(valid: np.ndarray, weight: np.ndarray) -> bool:
    """Whether a strut can be trusted: of its nodes, with weights (k,), most are `valid` (k,)."""
    return bool(weight @ (valid > 0) >= MOST * weight.sum())


def verdict(converged: bool, valid_share: float) -> str:
    """`converged`, `flagged` (the loop did not end, or over 5 % of the nodes are doubtful) or
    `failed` (at least half are)."""
    if not valid_share > 0.5:
        return "failed"
    return "converged" if converged and valid_share >= 0.95 else "flagged"
