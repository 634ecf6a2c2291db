"""The micro mesh cut into struts and junctions, each strut a curved beam with measured sections.

What is nearest to the skeleton of a strut is the strut's, but for its ends: as far as the largest
ball that fits in a junction, the solid is the junction's.
"""

from dataclasses import dataclass

import numpy as np

from addvc.fem.mesh import Mesh, cell_volumes, nodal_volumes
from addvc.geometry.centre_line import Curve, along, arc_length, centre_line
from addvc.geometry.lines import nearest_line, resampled
from addvc.geometry.sections import section_areas
from addvc.geometry.skeleton import FREE_END, StrutGraph

STATIONS = 17
"""Sections along a strut at which it is described."""

LEAST = 24
"""Nodes of a strut, at least, for its motion to be fitted."""

NECK = 0.25
"""A section that is smaller than this share of the mean says that the strut is broken there."""


@dataclass(frozen=True, eq=False)
class Strut:
    """A strut between its junctions: `points` (g, 3) of its centre line, equidistant sections of
    `area` (g,); its nodes (k,) in the micro mesh with their weights (k,) (volume) and places (k,) on
    the line, 0 to g - 1; `ends`: its junctions, -1 for none; `span`: the length of
    the line, between the balls that fit in the junctions; `length`: from junction to junction.
    Voxels."""

    ends: tuple[int, int]
    points: np.ndarray
    area: np.ndarray
    span: float
    length: float
    nodes: np.ndarray
    weight: np.ndarray
    place: np.ndarray

    @property
    def whole(self) -> bool:
        """Whether both ends are junctions."""
        return FREE_END not in self.ends

    @property
    def broken(self) -> bool:
        """Whether a section is so thin that the solid hardly holds together."""
        return bool(self.area.min() < NECK * self.area.mean())

    @property
    def middle(self) -> np.ndarray:
        """(3,) of the line."""
        return self.points[len(self.points) // 2]

    @property
    def radius(self) -> float:
        """Of the circle with the mean area of its sections."""
        return float(np.sqrt(self.area.mean() / np.pi))

    @property
    def direction(self) -> np.ndarray:
        """Unit vector (3,) from end to end."""
        chord = self.points[-1] - self.points[0]
        return chord / np.linalg.norm(chord)


def partition(mesh: Mesh, graph: StrutGraph, excess: np.ndarray) -> list[Strut]:
    """Struts of a micro mesh, those with enough solid between their junctions to be measured.

    excess (nx, ny, nz): the grey level of the reference above that of the void."""
    if not graph.branches:
        return []
    volume, centre = np.abs(cell_volumes(mesh)), mesh.points[mesh.cells].mean(axis=1)
    weight = nodal_volumes(mesh)
    lines = [resampled(branch.points) for branch in graph.branches]
    cells, nodes = (nearest_line(lines, x) for x in (centre, mesh.points))
    struts = []
    for branch, line, own, held in zip(graph.branches, lines, cells, nodes, strict=True):
        radius = np.sqrt(volume[own].sum() / (np.pi * branch.length))
        trims = [radius if end == FREE_END else graph.radii[end] for end in branch.ends]
        bounds = trims[0], arc_length(line)[-1] - trims[1]
        if bounds[1] - bounds[0] < 2 * radius or min(len(own), len(held)) < LEAST:
            continue
        solid, skin = (
            Samples(n, x[n], w[n], along(line, x[n]))
            for n, x, w in ((own, centre, volume), (held, mesh.points, weight))
        )
        curve = centre_line(line, bounds, radius, excess)
        struts.append(measured_strut(branch.ends, trims, curve, solid, skin))
    return [strut for strut in struts if len(strut.nodes) >= LEAST]


@dataclass(frozen=True, eq=False)
class Samples:
    """Points (q, 3) of the mesh with their numbers (q,), weights (q,) and places along a line (q,)."""

    number: np.ndarray
    points: np.ndarray
    weight: np.ndarray
    s: np.ndarray


def measured_strut(
    ends: tuple[int, int], trims: list[float], curve: Curve, solid: Samples, skin: Samples
) -> Strut:
    """The beam along a curve of which `trims` are left out at both ends, its sections from the
    tetrahedra (`solid`, weights: volumes), and where on it the nodes (`skin`) are."""
    bounds = curve.middle - curve.half, curve.middle + curve.half
    dense = np.linspace(*bounds, 8 * STATIONS)
    arc = arc_length(curve(dense))
    stations = np.interp(np.linspace(0, arc[-1], STATIONS), arc, dense)
    s = curve.projected(solid.points, solid.s)
    radius = np.sqrt(solid.weight.sum() / np.ptp(s) / np.pi)
    area = section_areas(stations, s, solid.weight, radius / 2)
    of_node = curve.projected(skin.points, skin.s)
    inside = (of_node >= bounds[0]) & (of_node <= bounds[1])
    place = np.interp(of_node[inside], dense, arc / arc[-1] * (STATIONS - 1))
    return Strut(ends, curve(stations), area, float(arc[-1]), float(arc[-1] + sum(trims)),
                 skin.number[inside], skin.weight[inside], place)  # fmt: skip
