"""Bridges that a loading state tears: struts that the threshold broke, and that were broken indeed.

A bridge (`geometry.bridges`) is a guess: the image shows a strut thinner than the threshold keeps. Where
the two halves of what was no strut slide past each other, an elastic rod between them takes both off
course. Most bridges whose surroundings are in doubt are whole, though, and lost with the struts around
them (default twin, 28.5 %: 12 of 91), so that doubt alone tells nothing. Those in doubt are therefore
cut on trial, where they are thinnest (the breaks of the solid twin are within .3 voxel of that): one
layer of cells loses its stiffness and its points. The cut stays where the images near it are explained
better once what is in doubt has been carried by its neighbours (`mending.carried`), each half by
its own, and its sides then move apart. All of them are judged together, once in a state, since a cut
takes a stage of two factors; and where so little is in doubt that nothing is mended none is tried.

In the compressed solid of tests/solid_twin at 15 % two bridges are torn, by 5 and 9 voxels. Once their
halves are carried the misfit near them is .89 of that of whole ones, and the rms error of all nodes .149
voxel in the end, not .194; .129 without the nodes of the cuts (`analysis.truth.judged_nodes`). With
other noise the misfit is .70 of that, and the error .313 voxel, not .863. Where all bridges are whole
(three twins at 28.5 %, the solid at 8 %) it is 1.01 to 1.08, and the cut, were it kept, would cost up to
twice the error; at 12.3 % no bridge is in doubt.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from addvc.correlation.metric import Reference, residual, robust_square
from addvc.fem.mesh import Mesh

SOFT = 1e-3
"""Stiffness of a cut cell over that of the others: the mesh stays in one piece."""

DOUBT = 0.5
"""Share of the cells around a bridge that are in doubt where it is cut on trial."""

BETTER = 0.95
"""What a cut must leave of the misfit near it, at most."""

APART = 1.0
"""Voxels that both sides of a cut move apart, at least, in the end: else it heals."""

NEAR = 8.0
"""Voxels from a cut within which it is judged."""

AROUND, ACROSS = 1.0, 2.0
"""Voxels beyond the gap, and beyond the radius, that belong to a bridge and to a cut through it."""


@dataclass(frozen=True, eq=False)
class Joint:
    """A bridge in a mesh of m cells: where it is thinnest, voxels; those around it, and those across it
    there, (m,) bool; the nodes of the latter on either side, and from the middle of these to that of
    those (3,), voxels."""

    position: list[float]
    around: np.ndarray
    layer: np.ndarray
    sides: tuple[np.ndarray, np.ndarray]
    offset: np.ndarray


def joints_of(mesh: Mesh, bridges: Sequence[dict]) -> list[Joint]:
    """The bridges of bridges.json that the mesh holds."""
    middle = mesh.points[mesh.cells].mean(axis=1)
    found = []
    for bridge in bridges:
        place = np.array(bridge["thinnest"])
        away = np.linalg.norm(middle - place, axis=1)
        ahead = (mesh.points - place) @ np.array(bridge["direction"]) > 0
        across = ahead[mesh.cells].any(axis=1) & ~ahead[mesh.cells].all(axis=1)
        layer = across & (away < bridge["radius"] + ACROSS)
        around = np.linalg.norm(middle - bridge["position"], axis=1) < bridge["length"] / 2 + AROUND
        if around.any() and layer.any():
            nodes = np.unique(mesh.cells[layer])
            sides = nodes[ahead[nodes]], nodes[~ahead[nodes]]
            offset = mesh.points[sides[0]].mean(axis=0) - mesh.points[sides[1]].mean(axis=0)
            found.append(Joint(bridge["thinnest"], around, layer, sides, offset))
    return found


def torn_joints(mesh: Mesh, joints: Sequence[Joint], doubtful: np.ndarray) -> list[Joint]:
    """Bridges to cut on trial: those among doubtful nodes (n,)."""
    doubt = doubtful[mesh.cells].any(axis=1)
    return [joint for joint in joints if doubt[joint.around].mean() > DOUBT]


def layers(joints: Sequence[Joint]) -> np.ndarray:
    """Cells (m,) bool that a cut through any of these bridges goes across."""
    return np.any([joint.layer for joint in joints], axis=0)


def apart(joint: Joint, u: np.ndarray) -> float:
    """By how much u (n, 3) changes the distance of both sides of a cut, voxels: by nothing where they
    turn together."""
    ahead, behind = (u[nodes].mean(axis=0) for nodes in joint.sides)
    lengths = np.linalg.norm(joint.offset + ahead - behind), np.linalg.norm(joint.offset)
    return float(abs(lengths[0] - lengths[1]))


def misfit_near(
    reference: Reference, deformed: np.ndarray, u: np.ndarray, torn: np.ndarray, scale: float | None
) -> float:
    """Mean robust square of the residual (grey levels^2) under u (n, 3) at the points within NEAR of
    torn cells (m,), whose own do not count in the reference (`Problem.tear`)."""
    mesh, q = reference.mesh, reference.quadrature
    away, _ = cKDTree(mesh.points[mesh.cells[torn]].mean(axis=1)).query(
        q.points, distance_upper_bound=NEAR
    )
    r, inside = residual(reference, deformed, u)
    weight = q.weight * (inside & np.isfinite(away))
    return float(weight @ robust_square(r, scale) / max(weight.sum(), 1e-12))
