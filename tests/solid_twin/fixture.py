"""What the long solve gave, on disk: a few megabytes that are kept in the repository.

Corners and cells only, since the other nodes are the middles of edges (`solid.quadratic`);
displacements rounded to 2^-13 voxel, which halves the file.
"""

from __future__ import annotations

import json
import os
from dataclasses import asdict, dataclass
from pathlib import Path

import h5py
import numpy as np

from addvc.fem.mesh import Mesh
from addvc.images.files import atomic_path
from solid_twin.compression import Step
from solid_twin.foam import Foam
from solid_twin.solid import Tetrahedra, quadratic

FIXTURE = Path(__file__).parent / "foam.h5"

ROUNDING = 2.0**-13
"""Voxels."""


@dataclass(frozen=True, eq=False)
class Record:
    """A mesh, its displacement (n, 3) in each state, and how it came about.

    `curve` (steps, 3): nominal strain, force on the upper platen and energy, in units of Young's
    modulus and voxels."""

    foam: Foam
    mesh: Tetrahedra
    strains: np.ndarray
    displacements: list[np.ndarray]
    curve: np.ndarray
    made: dict

    @property
    def platens(self) -> np.ndarray:
        """(states + 1, 2) y of both faces, the reference first."""
        low, high = self.foam.low, self.foam.high
        return np.array([(low, high - e * (high - low)) for e in (0.0, *self.strains)])


def rounded(mesh: Mesh) -> Mesh:
    """The mesh as it will be stored: computed with what is on disk."""
    return Mesh(mesh.points.astype(np.float32), mesh.cells)


def save_record(
    path: str | os.PathLike, foam: Foam, mesh: Mesh, steps: list[Step], strains, made: dict
) -> None:
    """Write the states at `strains` out of all steps of a compression of `quadratic(mesh)`."""
    points = quadratic(mesh).points
    packed = {"compression": "gzip", "compression_opts": 9, "shuffle": True}
    with atomic_path(path) as temporary, h5py.File(temporary, "w") as file:
        file.create_dataset("points", data=mesh.points.astype(np.float32), **packed)
        file.create_dataset("cells", data=mesh.cells, **packed)
        for number, strain in enumerate(strains, start=1):
            step = next(step for step in steps if abs(step.strain - strain) < 1e-9)
            u = np.round((step.x - points) / ROUNDING) * ROUNDING
            file.create_dataset(f"displacement{number}", data=u.astype(np.float32), **packed)
        file["curve"] = np.array([(step.strain, step.force, step.energy) for step in steps])
        file.attrs["strains"] = strains
        file.attrs["foam"] = json.dumps(asdict(foam))
        file.attrs["made"] = json.dumps(made)


def load_record(path: str | os.PathLike = FIXTURE) -> Record:
    """What `save_record` wrote."""
    with h5py.File(path) as file:
        words = {
            key: tuple(value) if isinstance(value, list) else value
            for key, value in json.loads(file.attrs["foam"]).items()
        }
        strains = file.attrs["strains"][:]
        return Record(
            Foam(**words),
            quadratic(Mesh(file["points"][:], file["cells"][:])),
            strains,
            [file[f"displacement{n}"][:].astype(float) for n in range(1, len(strains) + 1)],
            file["curve"][:],
            json.loads(file.attrs["made"]),
        )
