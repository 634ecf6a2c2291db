"""The standard uncertainty of each node from the noise of the images, and whether errors obey it.

Draws of noise are solved at rest, with the l_E of the state (`correlation/uncertainty.py`). Where the
frame of a method turns with the struts by R, which is smooth, its system is R A R^T, and its
right-hand side for the same noise R b: a draw turns with its strut, R u. Its length, and its parts
along the strut and normal to it, stay those at rest.

What is not in it: robust weights, struts that were mended or lost, and what a method cannot follow
because of its regularisation.
"""

from pathlib import Path

import h5py
import numpy as np

from addvc.analysis.struts import Strut
from addvc.fem.mesh import Mesh
from addvc.fem.rotations import nearest_rotation, nodal_average, smooth_rotations
from addvc.images.files import atomic_path

BINS = 10
"""Of nodes by their uncertainty, with equal numbers."""


def turned(mesh: Mesh, u: np.ndarray, draws: np.ndarray) -> np.ndarray:
    """Draws (d, n, 3) at rest in the frame of a state of displacement u (n, 3), that of
    `corotational`."""
    flat = nodal_average(mesh) @ smooth_rotations(mesh, u).reshape(-1, 9)
    rotation = nearest_rotation(flat.reshape(-1, 3, 3)).astype(draws.dtype)
    return np.einsum("nij,dnj->dni", rotation, draws)


def standard_uncertainty(draws: np.ndarray) -> np.ndarray:
    """(n,) voxels: rms length of draws (d, n, 3), which have no mean."""
    return np.sqrt(np.square(draws, dtype=float).sum(axis=2).mean(axis=0))


def sampling_error(count: int) -> float:
    """Relative deviation of a standard deviation from `count` draws of three components alike:
    1 / sqrt(2 (3 d))."""
    return float(1 / np.sqrt(6 * count))


def strut_uncertainty(struts: list[Strut], draws: np.ndarray) -> np.ndarray:
    """(s, 2) voxels: of each strut, over its nodes by volume, the rms of draws (d, n, 3) normal to its
    line and along it."""
    found = np.empty((len(struts), 2))
    for row, strut in zip(found, struts, strict=True):
        slope = np.gradient(strut.points, axis=0)
        slope /= np.linalg.norm(slope, axis=1, keepdims=True)
        u = draws[:, strut.nodes].astype(float)
        along = np.einsum("dki,ki->dk", u, slope[np.rint(strut.place).astype(int)]) ** 2
        whole = (u**2).sum(axis=2)
        row[:] = np.stack([whole - along, along]).mean(axis=1) @ strut.weight / strut.weight.sum()
    return np.sqrt(np.maximum(found, 0))


def figures(uncertainty: np.ndarray, struts: np.ndarray, count: int) -> dict:
    """Of the nodes (n,): rms, median, 95th percentile; of the struts (s, 2) the medians normal and
    along; voxels. How many draws, and what their number leaves open."""
    middle, far = np.percentile(uncertainty, (50, 95))
    normal, along = np.median(struts, axis=0) if len(struts) else (np.nan, np.nan)
    return {
        "rms": float(np.sqrt(np.mean(uncertainty**2))),
        "median": float(middle),
        "p95": float(far),
        "struts_normal": float(normal),
        "struts_along": float(along),
        "draws": count,
        "sampling_error": sampling_error(count),
    }


def save_uncertainty(path: str | Path, nodes: np.ndarray, struts: np.ndarray) -> None:
    """HDF5: `nodes` (n,); `struts` (s, 2), normal and along; voxels."""
    with atomic_path(path) as temporary, h5py.File(temporary, "w") as file:
        file["nodes"], file["struts"] = nodes, struts
        file.attrs["unit"] = "voxel of the binned image"


def load_uncertainty(path: str | Path) -> tuple[np.ndarray, np.ndarray]:
    """What `save_uncertainty` wrote."""
    with h5py.File(path) as file:
        return file["nodes"][:], file["struts"][:]


def calibration(error: np.ndarray, uncertainty: np.ndarray) -> dict:
    """Errors (n, 3) of nodes of uncertainty (n,): rms of either and their ratio, share of errors below
    twice the uncertainty; the same rms in bins of equal numbers of nodes."""
    length = np.linalg.norm(error, axis=1)
    order = np.array_split(np.argsort(uncertainty, kind="stable"), BINS)
    bins = [part for part in order if len(part)]
    predicted, actual = rms(uncertainty), rms(length)
    return {
        "count": len(length),
        "predicted": predicted,
        "actual": actual,
        "ratio": actual / predicted if predicted > 0 else float("nan"),
        "within_2": float(np.mean(length < 2 * uncertainty)) if len(length) else float("nan"),
        "bins": [[rms(uncertainty[part]), rms(length[part])] for part in bins],
    }


def rms(x: np.ndarray) -> float:
    """Of (n,), nan when there are none."""
    return float(np.sqrt(np.mean(x**2))) if len(x) else float("nan")
