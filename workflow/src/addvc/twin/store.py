"""Foam and motions on disk: HDF5, written to a temporary name and renamed."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict

import h5py
import numpy as np

from addvc.images.files import atomic_path

from .frame import Motion
from .options import Specimen, TwinOptions
from .struts import Network

ARRAYS = ("nodes", "elements", "strut", "radii", "director", "kind")


@contextmanager
def _atomic(path: str | os.PathLike) -> Iterator[h5py.File]:
    with atomic_path(path) as temporary, h5py.File(temporary, "w") as file:
        yield file


def _write_foam(group: h5py.Group, network: Network) -> None:
    for name in ARRAYS:
        group[name] = getattr(network, name)
    body = network.body
    group.attrs.update(shape=body.shape, low=body.low, high=body.high, radius=body.radius)
    group.attrs["unit"] = "voxel of the binned image"


def _read_foam(group: h5py.Group) -> Network:
    a = group.attrs
    shape = tuple(int(n) for n in a["shape"])
    body = Specimen(shape, float(a["low"]), float(a["high"]), float(a["radius"]))
    return Network(*(group[name][:] for name in ARRAYS), body)


def _read_motion(group: h5py.Group) -> Motion:
    low, high = group.attrs["platens"]
    return Motion(group["positions"][:], group["rotations"][:], (float(low), float(high)))


def save_foam(path: str | os.PathLike, network: Network) -> None:
    """Write the reference network."""
    with _atomic(path) as file:
        _write_foam(file.create_group("foam"), network)


def load_foam(path: str | os.PathLike) -> Network:
    """Read the reference network from a file of `save_foam` or `save_motions`."""
    with h5py.File(path) as file:
        return _read_foam(file["foam"])


def save_motions(
    path: str | os.PathLike, network: Network, motions: list[Motion], options: TwinOptions
) -> None:
    """Write all that the truth needs: network, motion of each state, nominal strains, options."""
    with _atomic(path) as file:
        _write_foam(file.create_group("foam"), network)
        for state, motion in enumerate(motions):
            group = file.create_group(f"state{state}")
            group["positions"], group["rotations"] = motion.positions, motion.rotations
            group.attrs["platens"] = motion.platens
        file.attrs["strains"] = np.array([0.0, *options.strains])
        file.attrs["options"] = json.dumps(asdict(options))


def load_motions(path: str | os.PathLike) -> list[Motion]:
    """Motions of all states, the reference first."""
    with h5py.File(path) as file:
        return [_read_motion(file[f"state{s}"]) for s in range(len(file.attrs["strains"]))]


def load_strains(path: str | os.PathLike) -> tuple[float, ...]:
    """Nominal strain of each state, 0 for the reference first."""
    with h5py.File(path) as file:
        return tuple(float(e) for e in file.attrs["strains"])
