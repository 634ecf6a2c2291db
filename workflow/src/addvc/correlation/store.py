"""Solutions and factors on disk (HDF5), so that jobs can hand them to each other."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import h5py
import numpy as np
from scipy import sparse

from addvc.correlation.gauss_newton import Solution
from addvc.fem.mesh import Mesh, inverted_share
from addvc.images.files import atomic_path

if TYPE_CHECKING:
    from addvc.fem.solver import Factor


def save_solution(path: str | Path, solution: Solution, mesh: Mesh | None = None, **notes) -> None:
    """u (n, 3) in voxels, history, verdict; `notes` is anything JSON knows (e.g. a table). Of a solution
    on a `mesh`, `inverted` of the notes is the share of its cells that u turns inside out."""
    if mesh is not None:
        notes["inverted"] = inverted_share(mesh, solution.u)
    with atomic_path(path) as temporary, h5py.File(temporary, "w") as file:
        file["u"] = solution.u
        file["u"].attrs["unit"] = "voxel"
        file["history"] = np.array(solution.history, dtype=float)
        file.attrs["converged"] = solution.converged
        file.attrs["seconds"] = solution.seconds
        file.attrs["residual"] = json.dumps(solution.residual)
        file.attrs["notes"] = json.dumps(notes)


def load_solution(path: str | Path) -> tuple[Solution, dict]:
    """A solution and its notes."""
    with h5py.File(path) as file:
        solution = Solution(
            file["u"][:],
            file["history"][:].tolist(),
            bool(file.attrs["converged"]),
            float(file.attrs["seconds"]),
            json.loads(file.attrs["residual"]),
        )
        return solution, json.loads(file.attrs["notes"])


def save_field(path: str | Path, u: np.ndarray, **notes) -> None:
    """A displacement (n, 3) in voxels that is no solution of its own (a start, a transfer)."""
    with atomic_path(path) as temporary, h5py.File(temporary, "w") as file:
        file["u"] = u
        file["u"].attrs["unit"] = "voxel"
        file.attrs["notes"] = json.dumps(notes)


def load_field(path: str | Path) -> np.ndarray:
    """u (n, 3) of a field or of a solution."""
    with h5py.File(path) as file:
        return file["u"][:]


def load_notes(path: str | Path) -> dict:
    """What was noted with a field or a solution."""
    with h5py.File(path) as file:
        return json.loads(file.attrs["notes"])


def save_factor(
    path: str | Path, factor: Factor, regularisation: sparse.csr_matrix, weights: dict
) -> None:
    """The factor of A = H + M with M itself, and the weights of its terms."""
    with atomic_path(path) as temporary, h5py.File(temporary, "w") as file:
        for name, matrix in (("L", factor.lower), ("M", regularisation)):
            group = file.create_group(name)
            group["data"], group["indices"], group["indptr"] = (
                matrix.data,
                matrix.indices,
                matrix.indptr,
            )
            group.attrs["shape"] = matrix.shape
        file["order"] = factor.order
        file.attrs["weights"] = json.dumps(weights)


def load_order(path: str | Path) -> tuple[np.ndarray, dict]:
    """Order of elimination (3 n,), which serves every matrix of the same pattern, and weights."""
    with h5py.File(path) as file:
        return file["order"][:], json.loads(file.attrs["weights"])


def load_factor(path: str | Path) -> tuple[Factor, sparse.csr_matrix, dict]:
    """What `save_factor` wrote."""
    from addvc.fem.solver import Factor  # and with it numba, which most jobs that read do without

    with h5py.File(path) as file:
        parts = {
            name: (file[name]["data"][:], file[name]["indices"][:], file[name]["indptr"][:])
            for name in ("L", "M")
        }
        shape = tuple(file["L"].attrs["shape"])
        lower = sparse.csc_matrix(parts["L"], shape=shape)
        factor = Factor(lower, file["order"][:])
        return factor, sparse.csr_matrix(parts["M"], shape=shape), json.loads(file.attrs["weights"])
