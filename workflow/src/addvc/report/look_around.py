"""The micro result in 3D, as one HTML file that turns in a browser and needs no network.

The page is `workflow/report/scene.html`, drawn by plotly.js, which is put into it with the data: whole
numbers of 16 bits in base64, each array with its lowest value and step.
"""

import base64
import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import Normalize, to_hex
from plotly.offline import get_plotlyjs

from addvc.analysis.strut_store import load_partition, read_columns
from addvc.fem.io import read_vtu
from addvc.fem.mesh import Mesh, cell_volumes, outer_faces
from addvc.images.files import atomic_path
from addvc.report import style
from addvc.report.case import Case
from addvc.report.scene import oblique
from addvc.report.surfaces import centroids, compact

MOST_BYTES = 14e6
"""Of the arrays before base64: with plotly.js the file then stays below 25 MB."""

UNKNOWN = 2**16 - 1
"""Stands for nan."""


@dataclass(frozen=True)
class Shown:
    """A field that can be chosen: its name with the unit, its map, whether it is about zero, and its
    range where that is known beforehand."""

    label: str
    cmap: str = style.MAGNITUDE
    signed: bool = False
    bounds: tuple[float, float] | None = None


def shown_fields(axis: int) -> list[Shown]:
    """What `node_fields` gives, in its order."""
    along = style.AXES[axis]
    return [
        Shown(f"u_{along} less uniform compression (voxels)", style.SIGNED, signed=True),
        Shown("von Mises strain (–)"),
        Shown("share of bending in the energy of the strut (–)", bounds=(0, 1)),
    ]


def write_scene(case: Case, template: str | Path, output: str | Path) -> None:
    """`output` (.html): the page `template` with plotly.js and the micro result in all states."""
    data = json.dumps(scene_data(case), separators=(",", ":"), allow_nan=False)
    page = Path(template).read_text(encoding="utf-8")
    page = page.replace("{{plotly}}", get_plotlyjs()).replace(
        "{{data}}", data.replace("</", "<\\/")
    )
    with atomic_path(output) as temporary:
        Path(temporary).write_text(page, encoding="utf-8")


def scene_data(case: Case) -> dict:
    """All that the page shows: surface, displacement, fields, flags, ranges and words."""
    axis, mesh = case.specimen.axis, case.mesh(case.micro[0])
    points, faces, used, part = shown_surface(mesh, axis, most_faces(len(case.states)))
    owner = strut_of_nodes(case, len(mesh.points))
    found = [measured(case, state, mesh, owner) for state in case.states]
    states = [
        {
            "label": case.title(state, case.micro[0]),
            "u": [packed(component) for component in u[used].T],
            "fields": [packed(values[used]) for values in fields],
            "flagged": encoded(flagged[used].astype(np.uint8)),
        }
        for state, (u, fields, flagged) in zip(case.states, found, strict=True)
    ]
    values = zip(*(fields for _, fields, _ in found), strict=True)
    fields = [field_data(*pair) for pair in zip(shown_fields(axis), values, strict=True)]
    return {
        "case": case.root.name,
        "axis": style.AXES[axis],
        "eye": (2.2 * oblique(axis).towards).tolist(),
        "up": np.eye(3)[axis].tolist(),
        "voxel_um": case.voxel_um,
        "points": [packed(component) for component in points.T],
        "faces": encoded(faces.astype("<u4")),
        "states": states,
        "fields": fields,
        "first": case.states.index(case.shown_state()),
        "part": part,
        "name": case.micro[0],
    }


def most_faces(states: int) -> int:
    """Triangles that fit in MOST_BYTES: three numbers of 4 bytes each, and half a point each with 2
    bytes a coordinate, component and value, and a flag, in each state."""
    return int(MOST_BYTES / (12 + 0.5 * (6 + states * (6 + 2 * len(shown_fields(0)) + 1))))


def shown_surface(
    mesh: Mesh, axis: int, most: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray, str]:
    """Points, triangles, the nodes that the points are, and words on what is shown: the boundary of
    the mesh, or, of a larger one, that of a slab along the loading axis with about `most` triangles."""
    faces, _ = outer_faces(mesh)
    words = ""
    if len(faces) > most:
        normal = 0 if axis != 0 else 1
        distance = np.abs(centroids(mesh)[:, normal] - np.median(mesh.points[:, normal]))
        half = np.quantile(distance, 0.9 * most / len(faces))
        faces, _ = outer_faces(mesh, distance <= half)
        words = (
            f"To keep the file small, only a slab {2 * half:.0f} voxels thick across "
            f"{style.AXES[normal]} is shown, from the middle of the specimen."
        )
    return (*compact(mesh.points, faces), words)


def strut_of_nodes(case: Case, nodes: int) -> np.ndarray:
    """(n,) the number of the strut of each node of the micro mesh, -1 in a junction."""
    owner = np.full(nodes, -1)
    for number, strut in enumerate(load_partition(case.path("geometry/struts.h5"))[0]):
        owner[strut.nodes] = number
    return owner


def measured(
    case: Case, state: int, mesh: Mesh, owner: np.ndarray
) -> tuple[np.ndarray, list[np.ndarray], np.ndarray]:
    """u (n, 3), the fields of `shown_fields`, each (n,), and whether a node is flagged (n,): itself, or
    its strut."""
    _, _, point, cell = read_vtu(case.path(f"fields/{case.micro[0]}_state{state}.vtu"))
    struts = read_columns(case.path(f"struts_state{state}.csv"))
    sound = np.append(struts["valid"] > 0, True)  # the last: of no strut
    share = np.append(np.where(sound[:-1], struts["bending_share"], np.nan), np.nan)
    u, valid = point["displacement"], point["valid"].ravel() > 0
    fields = [
        beyond_uniform(mesh.points, u, case.specimen.axis, valid),
        at_nodes(mesh, cell["strain_norm"].ravel()),
        share[owner],
    ]
    return u, fields, ~(valid & sound[owner])


def beyond_uniform(points: np.ndarray, u: np.ndarray, axis: int, valid: np.ndarray) -> np.ndarray:
    """u (n, 3) along the axis less the straight line through it that fits the `valid` nodes best."""
    use = valid if valid.sum() > 2 else np.ones(len(u), bool)
    line = np.polynomial.Polynomial.fit(points[use, axis], u[use, axis], 1)
    return u[:, axis] - line(points[:, axis])


def at_nodes(mesh: Mesh, values: np.ndarray) -> np.ndarray:
    """Values (m,) of cells as means (n,) at the nodes, weighted with the volumes."""
    volume = np.abs(cell_volumes(mesh))
    total, weight = (
        np.bincount(mesh.cells.ravel(), np.repeat(v, mesh.cells.shape[1]), len(mesh.points))
        for v in (volume * values, volume)
    )
    return total / np.maximum(weight, 1e-300)


def field_data(field: Shown, values: list[np.ndarray]) -> dict:
    """Name, colours and ranges of a field with `values` (n,) in each state: of all, and of each."""

    def bounds(part) -> list[float]:
        known = [v[np.isfinite(v)] for v in part]
        if field.bounds or not any(map(len, known)):
            return list(field.bounds or (0, 1))
        norm: Normalize = style.robust_range(known, field.signed, share=1.0)
        return [norm.vmin, norm.vmax] if field.signed else [0.0, norm.vmax]

    colours = colormaps[field.cmap](np.linspace(0, 1, 33))
    return {
        "label": field.label,
        "colours": [to_hex(colour) for colour in colours],
        "range": bounds(values),
        "ranges": [bounds([v]) for v in values],
    }


def packed(values: np.ndarray) -> dict:
    """Values (n,) as whole numbers of 16 bits: value = low + step * number, UNKNOWN for nan."""
    known = np.isfinite(values)
    low, high = (values[known].min(), values[known].max()) if known.any() else (0.0, 0.0)
    step = max(float(high - low), 1e-30) / (UNKNOWN - 1)
    numbers = np.where(known, np.rint((np.where(known, values, low) - low) / step), UNKNOWN)
    return {"low": float(low), "step": step, "data": encoded(numbers.astype("<u2"))}


def encoded(array: np.ndarray) -> str:
    """The bytes of an array in base64."""
    return base64.b64encode(np.ascontiguousarray(array).tobytes()).decode("ascii")
