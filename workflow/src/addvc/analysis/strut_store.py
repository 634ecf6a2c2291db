"""Struts on disk: the partition of a mesh (HDF5), and what they undergo in a state (CSV)."""

import csv
from dataclasses import fields
from pathlib import Path

import h5py
import numpy as np

from addvc.analysis.struts import Strut
from addvc.fem.mesh import Mesh
from addvc.images.files import atomic_path

WORDS = ("neighbours", "flag", "dominance")
"""How columns begin whose entries are no numbers, though one neighbour looks like one."""

RAGGED = ("nodes", "weight", "place")
"""Arrays whose length differs from strut to strut, kept end to end."""


def save_partition(path: str | Path, struts: list[Strut], junctions: np.ndarray) -> None:
    """Struts of a mesh and the junctions (j, 3) between them."""
    with atomic_path(path) as temporary, h5py.File(temporary, "w") as file:
        file["junctions"] = junctions
        file["count"] = np.array([len(strut.nodes) for strut in struts], dtype=np.int64)
        for name in (field.name for field in fields(Strut)):
            values = [getattr(strut, name) for strut in struts]
            joined = struts and name in RAGGED
            file[name] = np.concatenate(values) if joined else np.array(values)
        file.attrs["unit"] = "voxel of the binned image"


def load_partition(path: str | Path) -> tuple[list[Strut], np.ndarray]:
    """What `save_partition` wrote."""
    with h5py.File(path) as file:
        if len(file["count"]) == 0:
            return [], file["junctions"][:]
        cuts = np.cumsum(file["count"][:])[:-1]
        columns = {}
        for name in (field.name for field in fields(Strut)):
            values = file[name][:]
            columns[name] = np.split(values, cuts) if name in RAGGED else values
        ends = [tuple(map(int, pair)) for pair in columns.pop("ends")]
        names, rows = list(columns), zip(*columns.values(), strict=True)
        struts = [
            Strut(ends=pair, **dict(zip(names, row, strict=True)))
            for pair, row in zip(ends, rows, strict=True)
        ]
        return struts, file["junctions"][:]


def strut_of_cells(struts: list[Strut], mesh: Mesh) -> np.ndarray:
    """(m,) the strut of each tetrahedron, where all its nodes are of one, else -1."""
    label = np.full(len(mesh.points), -1)
    for number, strut in enumerate(struts):
        label[strut.nodes] = number
    corners = label[mesh.cells]
    return np.where((corners == corners[:, :1]).all(axis=1), corners[:, 0], -1)


def write_columns(path: str | Path, columns: dict[str, list]) -> None:
    """Columns of equal length as CSV; numbers with six significant digits."""
    rows = zip(*columns.values(), strict=True)
    with atomic_path(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(columns)
        table.writerows([[_text(value) for value in row] for row in rows])


def _text(value) -> str:
    return f"{value:.6g}" if isinstance(value, float | np.floating) else str(value)


def read_columns(path: str | Path) -> dict[str, np.ndarray]:
    """Columns of a file of `write_columns`, as numbers but for WORDS."""
    with Path(path).open(newline="", encoding="utf-8") as file:
        header, *rows = list(csv.reader(file))
    return {
        name: np.array([row[n] for row in rows], dtype=str if name.startswith(WORDS) else float)
        for n, name in enumerate(header)
    }
