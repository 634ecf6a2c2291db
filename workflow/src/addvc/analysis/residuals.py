"""Section 4.2.2: residuals of every result on one support, the points of the micro quadrature."""

from pathlib import Path

import h5py
import numpy as np

from addvc.correlation.doubt import nodal_square
from addvc.correlation.metric import Reference, residual, residual_statistics
from addvc.images.files import atomic_path

ARRAYS = ("r", "inside", "weight", "node_square")


def residual_on(reference: Reference, deformed: np.ndarray, u: np.ndarray) -> dict:
    """Eq. 5 at the micro quadrature for u (n, 3) on micro nodes: arrays and their statistics.

    r, inside, weight (Q,) at the Gauss points, which come first, and `node_square` (n,), the mean
    r^2 around each node, in the shell too. Skewness and excess kurtosis, zero for a normal
    distribution, are those of the points inside."""
    r, inside = residual(reference, deformed, u)
    square = nodal_square(reference, r, inside)
    gauss = slice(4 * len(reference.mesh.cells))
    r, inside, weight = r[gauss], inside[gauss], reference.quadrature.weight[gauss]
    statistics = residual_statistics(r, inside, weight)
    scaled = (r[inside] - statistics["mean"]) / max(statistics["std"], 1e-12)
    total = weight[inside].sum()  # none when the whole displacement has left the image
    for name, power, normal in (("skewness", 3, 0.0), ("kurtosis", 4, 3.0)):
        moment = (weight[inside] * scaled**power).sum() / total if total else np.nan
        statistics[name] = float(moment - normal)
    arrays = (r, inside, weight, square)
    return dict(zip(ARRAYS, arrays, strict=True)) | {"statistics": statistics}


def save_residual(path: str | Path, result: dict) -> None:
    """HDF5: r, inside, weight (Q,), node_square (n,), statistics as attributes."""
    with atomic_path(path) as temporary, h5py.File(temporary, "w") as file:
        for name in ARRAYS:
            file[name] = result[name]
        file.attrs.update(result["statistics"])


def load_residual(path: str | Path) -> dict:
    """What `save_residual` wrote."""
    with h5py.File(path) as file:
        arrays = {name: file[name][:] for name in ARRAYS}
        return arrays | {
            "statistics": {key: np.asarray(value).item() for key, value in file.attrs.items()}
        }


def by_cell(values: np.ndarray, weight: np.ndarray, inside: np.ndarray, cells: int) -> np.ndarray:
    """Weighted mean (m,) of values (Q,) that come in equal numbers per cell; nan where none is."""
    w = np.where(inside, weight, 0.0).reshape(cells, -1)
    total = w.sum(axis=1)
    mean = (w * values.reshape(cells, -1)).sum(axis=1)
    return np.where(total > 0, mean / np.maximum(total, 1e-300), np.nan)
