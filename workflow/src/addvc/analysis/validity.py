"""What can be trusted: the grey residual around a node or a strut against the image's own noise."""

import numpy as np

from addvc.correlation.doubt import residual_limit
from addvc.fem.mesh import Mesh

MOST = 0.7
"""Share of the nodes of a strut, by volume, that must be valid."""


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
