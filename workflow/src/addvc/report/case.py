"""The results of one case on disk, as figures and tables read them."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

import h5py
import numpy as np

from addvc.analysis.validity import verdict
from addvc.config import mesh_name
from addvc.correlation.gauss_newton import Solution
from addvc.correlation.store import load_notes, load_solution
from addvc.fem.io import read_mesh, read_vtu
from addvc.fem.mesh import Mesh
from addvc.images.files import read_json
from addvc.images.scans_store import load_volume
from addvc.images.specimen import Specimen
from addvc.report.style import Colour, series

PICTURED = 6
"""States in a row of pictures, at most."""

FOLDED = 0.01
"""Share of elements turned inside out over which it is told."""


class UndeclaredInput(RuntimeError):
    """A figure reads a file that its rule does not name, so that a change would not remake it."""


@dataclass(frozen=True)
class Case:
    """Folder of results, states with their labels, names of the meso meshes (coarse to fine) and of
    the micro results, edge of a voxel of the binned images in µm; `inputs`: the only files that may be
    read (None for any)."""

    root: Path
    labels: dict[int, str]
    meso: tuple[str, ...]
    micro: tuple[str, ...]
    voxel_um: float
    inputs: frozenset[Path] | None = field(default=None, repr=False)

    @classmethod
    def of(cls, description: dict, inputs: Iterable[str] | None = None) -> "Case":
        """From {root, labels, meso, micro, voxel_um}, and the input files of the job."""
        allowed = None if inputs is None else frozenset(Path(name) for name in inputs)
        labels = {int(n): label for n, label in description["labels"].items()}
        return cls(
            Path(description["root"]),
            labels,
            tuple(description["meso"]),
            tuple(description["micro"]),
            float(description["voxel_um"]),
            allowed,
        )

    @property
    def states(self) -> list[int]:
        return sorted(self.labels)

    @property
    def pictured(self) -> list[int]:
        """The states that rows of pictures have room for: of many, PICTURED from first to last."""
        if len(self.states) <= PICTURED:
            return self.states
        places = np.linspace(0, len(self.states) - 1, PICTURED)
        return [self.states[place] for place in places.round().astype(int)]

    def colour(self, state: int) -> Colour:
        """Of the curves of a state, the same in all figures."""
        return series(len(self.states))[self.states.index(state)]

    @property
    def finest(self) -> str:
        """The finest meso mesh."""
        return self.meso[-1]

    def path(self, name: str) -> Path:
        """A file of the case; UndeclaredInput unless the job declares it."""
        path = self.root / name
        if self.inputs is not None and path not in self.inputs:
            raise UndeclaredInput(
                f"{path} is not among the {len(self.inputs)} inputs of this job; "
                "add it to the rule in workflow/rules/figures.smk"
            )
        return path

    def json(self, name: str) -> dict:
        return read_json(self.path(name))

    @property
    def specimen(self) -> Specimen:
        return Specimen.from_dict(self.json("geometry/specimen.json"))

    @property
    def gamma(self) -> float:
        """The threshold between void and solid."""
        return float(self.json("geometry/threshold.json")["threshold"])

    @property
    def cell_size(self) -> float:
        """Voxels."""
        return float(self.json("geometry/cell_size.json")["cell_size"])

    def image(self, state: int, smooth: bool = True) -> np.ndarray:
        """Volume (nx, ny, nz) of a state, 0 for the reference."""
        return load_volume(self.path(image_name(state, smooth)))[0]

    def mesh(self, name: str) -> Mesh:
        return read_mesh(self.path(f"geometry/{mesh_name(name)}.vtu"))

    def mesh_facts(self, name: str) -> dict:
        return self.json(f"geometry/{mesh_name(name)}.json")

    def penalised(self) -> np.ndarray:
        """0 free or bulk, 1 ends, 2 sides for each node (n,) of the micro mesh (Fig. 9)."""
        return read_vtu(self.path("geometry/micro.vtu"))[2]["penalised"].ravel()

    def solution(self, mesh: str, state: int) -> Solution:
        return load_solution(self.path(f"dvc/{mesh}_state{state}.h5"))[0]

    def cutoffs(self, mesh: str) -> list[float]:
        """l_E of a micro result of the default kind, or l_L of a meso result, in each state (voxels)."""
        key = "l_e" if mesh in self.micro else "l_l"
        return [float(self.notes(mesh, state)[key]) for state in self.states]

    def notes(self, mesh: str, state: int) -> dict:
        """What was noted with a solution."""
        return load_notes(self.path(f"dvc/{mesh}_state{state}.h5"))

    def displacement(self, mesh: str, state: int) -> np.ndarray:
        """u (n, 3) in voxels at the nodes of the micro mesh, of a micro or a meso result."""
        middle = "" if mesh in self.micro else "_on_micro"
        with h5py.File(self.path(f"dvc/{mesh}{middle}_state{state}.h5")) as file:
            return file["u"][:].astype(np.float64)

    def residual(self, mesh: str, state: int) -> tuple[np.ndarray, np.ndarray, dict]:
        """r (Q,) at the micro Gauss points, cell by cell, with weight 0 outside of the image."""
        with h5py.File(self.path(f"analysis/residual_{mesh}_state{state}.h5")) as file:
            weight = np.where(file["inside"][:], file["weight"][:], 0.0)
            return file["r"][:], weight, dict(file["r"].parent.attrs)

    def converged(self, mesh: str, state: int) -> bool:
        with h5py.File(self.path(f"dvc/{mesh}_state{state}.h5")) as file:
            return bool(file.attrs["converged"])

    def valid(self, mesh: str, state: int) -> np.ndarray:
        """(n,): 1 for a node of a micro result whose residual is no more than noise explains, or 0."""
        return read_vtu(self.path(f"fields/{mesh}_state{state}.vtu"))[2]["valid"]

    def valid_share(self, mesh: str, state: int) -> float:
        """Share of such nodes."""
        return float(self.valid(mesh, state).mean())

    def status(self, mesh: str, state: int) -> str:
        """Nothing for a good result; `failed` when most of the struts are off; `not converged`."""
        converged = self.converged(mesh, state)
        if mesh in self.micro and verdict(converged, self.valid_share(mesh, state)) == "failed":
            return "failed"
        return "" if converged else "not converged"

    def flagged(self, state: int) -> int:
        """How many struts the default micro method cannot be trusted on."""
        foam = self.json(f"struts_state{state}.json")["foam"]
        return int(foam[self.micro[0]]["flagged"])

    def verdict(self, mesh: str, state: int) -> str:
        """What to think of a result: `converged`, `not converged` or `failed`; with the share of the
        elements that it turns inside out, where these are more than a few, and of the default micro
        method with the number of struts that are flagged."""
        words = self.status(mesh, state) or "converged"
        inverted = load_notes(self.path(f"dvc/{mesh}_state{state}.h5"))["inverted"]
        if inverted > FOLDED:
            words += f", {100 * inverted:.1f} % inverted"
        if mesh != self.micro[0] or words == "failed":
            return words
        count = self.flagged(state)
        return f"{words}, {count} strut{'s' * (count > 1)} flagged" if count else words

    def title(self, state: int, mesh: str) -> str:
        """The label of a state, and what to think of its result on a mesh."""
        return f"{self.labels[state]}: {self.verdict(mesh, state)}"

    def shown_state(self) -> int:
        """The last state that both the finest meso mesh and `micro` got right, else the last."""
        good = [
            n
            for n in self.states
            if not (self.status(self.micro[0], n) or self.status(self.finest, n))
        ]
        return (good or self.states)[-1]


def image_name(state: int, smooth: bool = True) -> str:
    return f"volumes/{'smooth' if smooth else 'volume'}{state}.h5"
