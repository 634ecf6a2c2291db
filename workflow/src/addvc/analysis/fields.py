"""A result as fields on its own mesh: displacement, validity, strain, residual."""

from collections.abc import Sequence

import numpy as np

from addvc.analysis.residuals import by_cell
from addvc.analysis.validity import nodal_residual, valid_nodes
from addvc.correlation.transfer import locate
from addvc.fem.mesh import Mesh
from addvc.fem.operators import strain


def result_fields(
    mesh: Mesh,
    u: np.ndarray,
    micro: Mesh,
    residual: dict,
    noise: float,
    torn: Sequence[int] = (),
) -> tuple[dict, dict]:
    """Point and cell data of u (n, 3) on `mesh`, the residual being known on the `micro` mesh.

    Points: displacement (voxels), residual_rms around the node (grey levels), valid. Cells: strain
    (m, 9), its Frobenius norm (the paper's von Mises strain), residual (grey levels). nan where a
    meso cell holds no strut; torn cells have no strain either, and their nodes are not valid: there is
    no strut (`correlation.torn`)."""
    r, w, inside = residual["r"], residual["weight"], residual["inside"]
    mean = by_cell(r, w, inside, len(micro.cells))
    around = np.sqrt(residual["node_square"])
    if not np.array_equal(mesh.cells, micro.cells):
        owner, _ = locate(mesh, micro.points[micro.cells].mean(axis=1))
        mean = by_owner(mean, owner, len(mesh.cells))
        held, _ = locate(mesh, micro.points)
        around = nodal_residual(mesh, by_owner(residual["node_square"], held, len(mesh.cells)))
    tensor = strain(mesh, u)
    tensor[list(torn)] = np.nan
    valid = valid_nodes(around, noise).astype(np.uint8)
    valid[mesh.cells[list(torn)]] = 0
    points = {"displacement": u, "residual_rms": around, "valid": valid}
    cells = {
        "strain": tensor.reshape(-1, 9),
        "strain_norm": np.linalg.norm(tensor, axis=(1, 2)),
        "residual": mean,
    }
    return points, cells


def by_owner(values: np.ndarray, owner: np.ndarray, count: int) -> np.ndarray:
    """Mean (count,) of finite values (k,) by owner (k,); nan where there is none."""
    known = np.isfinite(values)
    total = np.bincount(owner[known], values[known], count)
    number = np.bincount(owner[known], minlength=count)
    return np.where(number > 0, total / np.maximum(number, 1), np.nan)
