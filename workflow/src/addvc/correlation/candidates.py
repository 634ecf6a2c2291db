"""Displacements from which any correlation of a state may start, on whatever mesh.

`freeform`: free-form DVC of the state, from nothing. The others need the state before, on the finest
meso mesh: `previous` is its displacement as it is, `extrapolated` that times the ratio of what the
platens have moved by since the reference, and `composed` the displacement followed by free-form DVC
from that state to this one (an updated reference).
"""

import logging
from collections.abc import Callable, Mapping

import numpy as np

from addvc.correlation.spline_grid import SplineGrid, evaluate
from addvc.correlation.store import load_field, load_solution
from addvc.correlation.transfer import transfer_matrix
from addvc.errors import CorrelationError
from addvc.fem.io import read_mesh
from addvc.images.platens import both_faces
from addvc.images.scans_store import load_volume

log = logging.getLogger(__name__)

Field = Callable[[np.ndarray], np.ndarray]  # u (n, 3) at points (n, 3), voxels


def spline_field(path: str) -> Field:
    """What free-form DVC wrote."""
    solution, notes = load_solution(path)
    grid = SplineGrid(**notes["grid"])
    coefficients = solution.u.reshape(*grid.shape, 3)
    return lambda points: evaluate(grid, coefficients, points)


def mesh_field(mesh: str, path: str) -> Field:
    """A displacement on a tetrahedral mesh; nearest cell outside of it."""
    u, cells = load_field(path), read_mesh(mesh)

    def at(points):
        into, outside = transfer_matrix(cells, points)
        log.info("%d of %d points are outside of %s: extrapolated", outside, len(points), mesh)
        return into @ u

    return at


def followed(first: Field, second: Field) -> Field:
    """A displacement, then another of the points where it has led to."""

    def at(points):
        u = first(points)
        return u + second(points + u)

    return at


def shortening(reference: np.ndarray, deformed: np.ndarray, axis: int) -> float:
    """By how much the platens have closed in, voxels. Raises CorrelationError where both images do not
    show both."""
    faces = both_faces(reference, deformed, axis)
    if faces is None:
        raise CorrelationError(
            f"the reference and a state do not both show both platens along axis {axis}, so that its "
            "displacement cannot be extrapolated; leave `extrapolated` out of meso.candidates"
        )
    return float(np.ptp(faces[0]) - np.ptp(faces[1]))


def platen_ratio(source: Mapping[str, str], axis: int) -> float:
    """Shortening of this state over that of the one before; 1 where that one had not moved."""
    reference, before, now = (
        load_volume(source[key])[0] for key in ("reference", "deformed_before", "deformed")
    )
    first = shortening(reference, before, axis)
    return shortening(reference, now, axis) / first if abs(first) > 0.1 else 1.0


def candidate(name: str, source: Mapping[str, str], axis: int) -> Field:
    """The field of a candidate from the files of a job: `freeform`, `finest`, `previous`, `step`,
    `reference`, `deformed_before`, `deformed`, each needed only where the name asks for it."""
    if name == "freeform":
        return spline_field(source["freeform"])
    previous = mesh_field(source["finest"], source["previous"])
    if name == "previous":
        return previous
    if name == "extrapolated":
        ratio = platen_ratio(source, axis)
        return lambda points: ratio * previous(points)
    return followed(previous, spline_field(source["step"]))
