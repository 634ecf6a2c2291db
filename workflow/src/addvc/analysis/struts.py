"""The micro mesh cut into struts and junctions, each strut a curved beam with measured sections.

What is nearest to the skeleton of a strut is the strut's, but for its ends: as far as the largest
ball that fits in a junction, the solid is the junction's. The centre line of a strut is a cubic through the
centroids of its tetrahedra: what a displacement says of stretching depends on it, since an offset d
of the line reads a curvature k as an axial strain k d.
"""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import polynomial
from scipy.spatial import cKDTree

from addvc.fem.mesh import Mesh, cell_volumes
from addvc.geometry.skeleton import FREE_END, StrutGraph

STATIONS = 17
"""Sections along a strut at which it is described."""

SPACING = 0.25
"""Of the points of a branch that nodes are given to, voxels."""

LEAST = 24
"""Nodes of a strut, at least, for its motion to be fitted."""

DEGREE = 3
"""Of the centre line, a polynomial of the arc length."""

PROJECTIONS = 4
"""Rounds of fitting the centre line and finding where on it each centroid is."""


@dataclass(frozen=True, eq=False)
class Strut:
    """A strut between its junctions: `points` (g, 3) of its centre line, equidistant sections of
    `area` (g,); its nodes (k,) in the micro mesh with their weights (k,) (volume) and places (k,) on
    the line, 0 to g - 1; `ends`: its junctions, -1 for none; `span`: its length between the balls
    that fit in the junctions. Voxels."""

    ends: tuple[int, int]
    points: np.ndarray
    area: np.ndarray
    span: float
    nodes: np.ndarray
    weight: np.ndarray
    place: np.ndarray

    @property
    def whole(self) -> bool:
        """Whether both ends are junctions."""
        return FREE_END not in self.ends

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


def partition(mesh: Mesh, graph: StrutGraph) -> list[Strut]:
    """Struts of a micro mesh, those with enough solid between their junctions to be measured."""
    volume, centre = np.abs(cell_volumes(mesh)), mesh.points[mesh.cells].mean(axis=1)
    weight = np.bincount(mesh.cells.ravel(), np.repeat(volume / 4, 4), len(mesh.points))
    lines = [resampled(branch.points, SPACING) for branch in graph.branches]
    cells, nodes = (nearest_line(lines, x) for x in (centre, mesh.points))
    struts = []
    for branch, line, own, held in zip(graph.branches, lines, cells, nodes, strict=True):
        trims = [0.0 if end == FREE_END else graph.radii[end] for end in branch.ends]
        bounds = measurable(line, volume[own].sum(), trims)
        if bounds is None or len(held) < LEAST:
            continue
        solid = Samples(centre[own], volume[own], along(line, centre[own]))
        skin = Samples(mesh.points[held], weight[held], along(line, mesh.points[held]))
        struts.append(measured_strut(branch.ends, bounds, solid, skin, held))
    return [strut for strut in struts if len(strut.nodes) >= LEAST]


def resampled(points: np.ndarray, spacing: float) -> np.ndarray:
    """A line (k, 3) of voxels, smoothed over its neighbours, as points of about equal spacing."""
    smooth = points.copy()
    smooth[1:-1] = (points[:-2] + 2 * points[1:-1] + points[2:]) / 4
    s = np.r_[0, np.cumsum(np.linalg.norm(np.diff(smooth, axis=0), axis=1))]
    at = np.linspace(0, s[-1], max(2, round(s[-1] / spacing) + 1))
    return np.stack([np.interp(at, s, x) for x in smooth.T], axis=1)


def nearest_line(lines: list[np.ndarray], points: np.ndarray) -> list[np.ndarray]:
    """For each line (k, 3), which of the points (q, 3) are nearest to it."""
    owner = np.repeat(np.arange(len(lines)), [len(line) for line in lines])
    label = owner[cKDTree(np.vstack(lines)).query(points)[1]]
    order = np.argsort(label, kind="stable")
    return np.split(order, np.searchsorted(label[order], np.arange(1, len(lines))))


def along(line: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Arc length (q,) of the point of a line (k, 3) that is nearest to each of the points (q, 3)."""
    s = np.r_[0, np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))]
    return s[cKDTree(line).query(points)[1]]


def measurable(line: np.ndarray, volume: float, trims: list[float]) -> tuple[float, float] | None:
    """Arc lengths (2,) between which a strut is free of its junctions (`trims` from the ends) or of
    its loose end (by its radius); None where it is not as long as it is wide."""
    length = np.linalg.norm(np.diff(line, axis=0), axis=1).sum()
    radius = np.sqrt(volume / (np.pi * max(length, 1e-9)))
    low, high = (trim or radius for trim in trims)
    return (low, length - high) if length - low - high > 2 * radius > 0 else None


@dataclass(frozen=True, eq=False)
class Curve:
    """Polynomials of the arc length, of x = (s - middle) / half: coefficients (d, 3)."""

    middle: float
    half: float
    coefficients: np.ndarray

    @classmethod
    def fit(
        cls, bounds: tuple[float, float], s: np.ndarray, points: np.ndarray, weight: np.ndarray
    ) -> "Curve":
        """By least squares of points (q, 3) at arc lengths (q,)."""
        middle, half = sum(bounds) / 2, (bounds[1] - bounds[0]) / 2
        x = (s - middle) / half
        return cls(middle, half, polynomial.polyfit(x, points, DEGREE, w=np.sqrt(weight)))

    def __call__(self, s: np.ndarray) -> np.ndarray:
        """Points (q, 3); straight on beyond the ends."""
        x = (s - self.middle) / self.half
        inner = np.clip(x, -1, 1)
        return self._value(self.coefficients, inner) + (x - inner)[:, None] * self._slope(inner)

    def tangent(self, s: np.ndarray) -> np.ndarray:
        """dx/ds (q, 3), of a length near one."""
        return self._slope(np.clip((s - self.middle) / self.half, -1, 1)) / self.half

    def _slope(self, x: np.ndarray) -> np.ndarray:
        return self._value(polynomial.polyder(self.coefficients), x)

    @staticmethod
    def _value(coefficients: np.ndarray, x: np.ndarray) -> np.ndarray:
        return polynomial.polyval(x, coefficients).T

    def projected(self, points: np.ndarray, s: np.ndarray) -> np.ndarray:
        """Arc lengths (q,) of points (q, 3) on the curve, from those given: Newton steps."""
        for _ in range(3):
            slope = self.tangent(s)
            step = np.einsum("qi,qi->q", points - self(s), slope)
            s = s + step / np.maximum(np.einsum("qi,qi->q", slope, slope), 1e-12)
        return s


@dataclass(frozen=True, eq=False)
class Samples:
    """Points (q, 3) of a strut with weights (q,) and arc lengths (q,)."""

    points: np.ndarray
    weight: np.ndarray
    s: np.ndarray


def measured_strut(
    ends: tuple[int, int],
    bounds: tuple[float, float],
    solid: Samples,
    skin: Samples,
    nodes: np.ndarray,
) -> Strut:
    """The beam that the centroids of tetrahedra (`solid`, weight: volume) describe between two arc
    lengths, and where on it the nodes (`skin`) are."""
    curve, s = centre_line(bounds, solid)
    dense = np.linspace(*bounds, 8 * STATIONS)
    arc = np.r_[0, np.cumsum(np.linalg.norm(np.diff(curve(dense), axis=0), axis=1))]
    stations = np.interp(np.linspace(0, arc[-1], STATIONS), arc, dense)
    radius = np.sqrt(solid.weight.sum() / np.ptp(s) / np.pi)
    area = section_areas(stations, Samples(solid.points, solid.weight, s), radius / 2)
    of_node = curve.projected(skin.points, skin.s)
    inside = (of_node >= bounds[0]) & (of_node <= bounds[1])
    place = np.interp(np.interp(of_node, dense, arc), [0, arc[-1]], [0, STATIONS - 1])
    return Strut(ends, curve(stations), area, float(arc[-1]), nodes[inside],
                 skin.weight[inside], place[inside])  # fmt: skip


def centre_line(bounds: tuple[float, float], solid: Samples) -> tuple["Curve", np.ndarray]:
    """A cubic of the arc length through the centroids between two arc lengths, by least squares
    weighted with volume, and the arc lengths (q,) of all centroids on it."""
    s = solid.s
    for _ in range(PROJECTIONS):
        use = (s >= bounds[0]) & (s <= bounds[1])
        curve = Curve.fit(bounds, s[use], solid.points[use], solid.weight[use])
        s = curve.projected(solid.points, s)
    return curve, s


def section_areas(stations: np.ndarray, solid: Samples, width: float) -> np.ndarray:
    """Area (g,) of the sections at arc lengths (g,): volume per length, by a Gaussian window."""
    window = np.exp(-0.5 * ((stations[:, None] - solid.s) / width) ** 2)
    return window @ solid.weight / (np.sqrt(2 * np.pi) * width)
