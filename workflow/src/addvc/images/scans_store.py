"""Volumes between the stages of the workflow: HDF5, (x, y, z), float32."""

import os

import h5py
import numpy as np
from numpy.typing import NDArray

from addvc.images.files import atomic_path


def save_volume(path: str | os.PathLike, volume: NDArray, attrs: dict | None = None) -> None:
    """Write (nx, ny, nz) as float32 dataset 'volume' of an HDF5 file, whole or not at all.

    attrs: more attributes (numbers, strings, lists of them), such as bin; axes is set here. The size of
    a voxel is not among them: nothing but figures and tables depends on it, and it is in input.json.
    """
    given = {"bin": 1, **(attrs or {}), "axes": "xyz"}
    chunks = tuple(min(64, n) for n in volume.shape)
    with atomic_path(path) as temporary, h5py.File(temporary, "w") as file:
        data = np.asarray(volume, dtype=np.float32)
        dataset = file.create_dataset("volume", data=data, chunks=chunks)
        dataset.attrs.update(given)


def load_volume(path: str | os.PathLike) -> tuple[NDArray[np.float32], dict]:
    """A volume written by save_volume: (nx, ny, nz) float32 and its attributes."""
    with h5py.File(path, "r") as file:
        dataset = file["volume"]
        attrs = {
            key: value.tolist() if isinstance(value, np.generic | np.ndarray) else value
            for key, value in dataset.attrs.items()
        }
        return dataset[...].astype(np.float32, copy=False), attrs


def load_coefficients(path: str | os.PathLike) -> tuple[NDArray[np.float32], int]:
    """A blurred volume as a spline (Eq. 4): its coefficients (nx, ny, nz) and the degree."""
    coefficients, attrs = load_volume(path)
    return coefficients, attrs["degree"]
