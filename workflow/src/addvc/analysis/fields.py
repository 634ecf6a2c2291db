"""A result as fields on its own mesh: displacement, validity, strain, residual."""

from collections.abc import Sequence

import numpy as np

from addvc.analysis.residuals import by_cell
from addvc.analysis.validity import nodal_residual, valid_nodes
from addvc.correlation.transfer import locate
from addvc.fem.mesh import Mesh
from addvc.fem.operators import strain

MEANING = {
    "displacement": ("voxel", "node", "u of I_r(x) = I_d(x + u), x y z"),
    "residual_rms": ("grey level", "node", "rms of the residual around it"),
    "valid": ("–", "node", "1: measured, the residual is what noise explains; 0: in doubt"),
    "uncertainty": (
        "voxel",
        "node",
        "standard, by the noise of the images, length of the vector (micro)",
    ),
    "strain": ("–", "cell", "xx xy xz yx yy yz zx zy zz; {}"),
    "strain_norm": ("–", "cell", "its Frobenius norm, the von Mises strain of the paper"),
    "residual": ("grey level", "cell", "mean of I_r(x) - I_d(x + u)"),
}
STRAINS = {
    "small": "small strain, the symmetric part of du/dx: it takes a turn for a strain",
    "green_lagrange": "Green-Lagrange strain: no turn changes it",
}


def described(kind: str) -> dict:
    """Unit, place and meaning of every field, with a `kind` of strain; where points are."""
    fields = {
        name: {"unit": unit, "of": place, "meaning": text.format(STRAINS[kind])}
        for name, (unit, place, text) in MEANING.items()
    }
    points = "voxel centres of the binned, cropped reference are at 0, 1, 2, ... along x, y, z"
    return {"fields": fields, "points": f"voxels; {points}"}


def result_fields(
    mesh: Mesh,
    u: np.ndarray,
    micro: Mesh,
    residual: dict,
    noise: float,
    torn: Sequence[int] = (),
    finite: bool = False,
) -> tuple[dict, dict]:
    """Point and cell data of u (n, 3) on `mesh`, the residual being known on the `micro` mesh.

    What there is, is in MEANING; the strain is that of Green and Lagrange where it is `finite`. nan
    where a meso cell holds no strut; torn cells have no strain either, and their nodes are not valid:
    there is no strut (`correlation.torn`)."""
    r, w, inside = residual["r"], residual["weight"], residual["inside"]
    mean = by_cell(r, w, inside, len(micro.cells))
    around = np.sqrt(residual["node_square"])
    if not np.array_equal(mesh.cells, micro.cells):
        owner, _ = locate(mesh, micro.points[micro.cells].mean(axis=1))
        mean = by_owner(mean, owner, len(mesh.cells))
        held, _ = locate(mesh, micro.points)
        around = nodal_residual(mesh, by_owner(residual["node_square"], held, len(mesh.cells)))
    tensor = strain(mesh, u, finite)
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
