"""Foam and motions on disk: HDF5, written to a temporary name and renamed."""

from __future__ import annotations

import csv
import json
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, fields

import h5py
import numpy as np

from addvc.fem.io import write_vtu
from addvc.images.files import atomic_path

from .compression import LoadStep
from .motion import Motion
from .options import Specimen, TwinOptions
from .structure import structure
from .strut_state import StrutStates, strut_states
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
    path: str | os.PathLike,
    network: Network,
    motions: list[Motion],
    options: TwinOptions,
    history: Sequence[LoadStep] = (),
) -> None:
    """Write all that the truth needs: network, motion of each state and what its struts undergo,
    nominal strains, options; and the load steps that led there."""
    held = structure(network, options)
    with _atomic(path) as file:
        _write_foam(file.create_group("foam"), network)
        for state, motion in enumerate(motions):
            group = file.create_group(f"state{state}")
            group["positions"], group["rotations"] = motion.positions, motion.rotations
            group.attrs["platens"] = motion.platens
            for name, values in strut_states(held, network.strut, motion)._asdict().items():
                group[f"struts/{name}"] = values
        for name in (field.name for field in fields(LoadStep)):
            file[f"history/{name}"] = np.array([getattr(step, name) for step in history])
        file.attrs["strains"] = np.array([0.0, *options.strains])
        file.attrs["options"] = json.dumps(asdict(options))


def load_motions(path: str | os.PathLike) -> list[Motion]:
    """Motions of all states, the reference first."""
    with h5py.File(path) as file:
        return [_read_motion(file[f"state{s}"]) for s in range(len(file.attrs["strains"]))]


def write_network(
    path: str | os.PathLike, network: Network, motion: Motion, options: TwinOptions
) -> None:
    """The beams of one state as lines in a VTU file: displacement, radius, and the energies and
    strains of the strut that each belongs to."""
    states = strut_states(structure(network, options), network.strut, motion)
    cells = {name: values[network.strut] for name, values in states._asdict().items()}
    cells |= {"radius": network.radii.mean(axis=1), "strut": network.strut}
    cells["strut_length"] = strut_lengths(network)[network.strut]
    moved = {"displacement": motion.positions - network.nodes}
    write_vtu(path, network.nodes, network.elements, moved, cells)


def strut_lengths(network: Network) -> np.ndarray:
    """(struts,) lengths along the struts of the reference."""
    chord = np.diff(network.nodes[network.elements], axis=1)[:, 0]
    return np.bincount(network.strut, np.linalg.norm(chord, axis=1))


def write_history(path: str | os.PathLike, history: Sequence[LoadStep]) -> None:
    """The load steps as CSV, a row a step."""
    names = [field.name for field in fields(LoadStep)]
    with atomic_path(path) as temporary, temporary.open("w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(names)
        table.writerows([getattr(step, name) for name in names] for step in history)


def load_struts(path: str | os.PathLike, state: int) -> StrutStates:
    """What the struts undergo in a state."""
    with h5py.File(path) as file:
        group = file[f"state{state}/struts"]
        return StrutStates(*(group[name][:] for name in StrutStates._fields))


def load_history(path: str | os.PathLike) -> dict[str, np.ndarray]:
    """The load steps: an array (steps,) for each field of `LoadStep`."""
    with h5py.File(path) as file:
        return {name: values[:] for name, values in file["history"].items()}


def load_strains(path: str | os.PathLike) -> tuple[float, ...]:
    """Nominal strain of each state, 0 for the reference first."""
    with h5py.File(path) as file:
        return tuple(float(e) for e in file.attrs["strains"])
