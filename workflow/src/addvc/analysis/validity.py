"""Which nodes can be trusted: the grey residual around a node against the image's own noise."""

import numpy as np

from addvc.fem.mesh import Mesh

LIMIT = 3.0  # of the noise of a difference of two images
MOST = 0.9  # of the nodes of a strut, by volume


def residual_limit(noise: float) -> float:
    """Largest residual (rms around a node) of a node that is right; `noise`: of one image."""
    return LIMIT * np.sqrt(2) * noise


def nodal_residual(mesh: Mesh, cell_square: np.ndarray) -> np.ndarray:
    """rms residual (n,) around each node from the mean r^2 of cells (m,); nan where none is known."""
    per_cell = mesh.cells.shape[1]
    square = np.repeat(cell_square, per_cell)
    known, nodes = np.isfinite(square), mesh.cells.ravel()
    total = np.bincount(nodes[known], square[known], len(mesh.points))
    count = np.bincount(nodes[known], minlength=len(mesh.points))
    return np.sqrt(np.where(count > 0, total / np.maximum(count, 1), np.nan))


def valid_nodes(mesh: Mesh, cell_square: np.ndarray, noise: float) -> np.ndarray:
    """(n,) bool: the residual around the node is below the limit, and known."""
    return nodal_residual(mesh, cell_square) <= residual_limit(noise)


def valid_strut(valid: np.ndarray, weight: np.ndarray) -> bool:
    """Whether a strut can be trusted: of its nodes, with weights (k,), most are `valid` (k,)."""
    return bool(weight @ (valid > 0) >= MOST * weight.sum())


def verdict(converged: bool, valid_share: float) -> str:
    """`converged`, `flagged` (the loop did not end, or over 5 % of the nodes are doubtful) or
    `failed` (at least half are)."""
    if not valid_share > 0.5:
        return "failed"
    return "converged" if converged and valid_share >= 0.95 else "flagged"
