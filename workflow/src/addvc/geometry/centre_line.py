"""The centre line of a strut, by the centroid of its grey level.

What a displacement says of stretching hangs on this line: an offset d reads a curvature k as an axial
strain k d. The grey level knows where it is better than the surface does, since voxels are partly
filled; a parabola is all that the noise allows a strut of a few voxels.
"""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import polynomial
from scipy.spatial import cKDTree

DEGREE = 2
"""Of the line, a polynomial of the arc length."""

MARGIN = 1.0
"""Voxels beyond the surface where the blur of the scan still has grey level of the strut."""

ROUNDS = 5
"""Of finding the line through the voxels near it, and the voxels near the line."""

LEAST = 12
"""Voxels that a line is found from, at least."""


@dataclass(frozen=True, eq=False)
class Curve:
    """Polynomials of x = (s - middle) / half, where s is about the arc length: coefficients (d, 3)."""

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
        return polynomial.polyval(inner, self.coefficients).T + (x - inner)[:, None] * self._slope(
            x
        )

    def tangent(self, s: np.ndarray) -> np.ndarray:
        """dx/ds (q, 3), of a length near one."""
        return self._slope((s - self.middle) / self.half) / self.half

    def astray(self, line: np.ndarray) -> float:
        """Distance (voxels) from a line (k, 3) of the point of the curve that is farthest from it."""
        points = self(np.linspace(self.middle - self.half, self.middle + self.half, 9))
        return float(cKDTree(line).query(points)[0].max())

    def _slope(self, x: np.ndarray) -> np.ndarray:
        return polynomial.polyval(np.clip(x, -1, 1), polynomial.polyder(self.coefficients)).T

    def projected(self, points: np.ndarray, s: np.ndarray) -> np.ndarray:
        """Arc lengths (q,) of points (q, 3) on the curve, from those given: Newton steps."""
        for _ in range(3):
            slope = self.tangent(s)
            step = np.einsum("qi,qi->q", points - self(s), slope)
            s = s + step / np.maximum(np.einsum("qi,qi->q", slope, slope), 1e-12)
        return s


def arc_length(line: np.ndarray) -> np.ndarray:
    """(k,) along a line of points (k, 3)."""
    return np.r_[0, np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))]


def along(line: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Arc length (q,) of the point of a line (k, 3) that is nearest to each of the points (q, 3)."""
    return arc_length(line)[cKDTree(line).query(points)[1]]


def centre_line(
    line: np.ndarray, bounds: tuple[float, float], radius: float, excess: np.ndarray
) -> Curve:
    """The curve between two arc lengths of a line (k, 3) through the centroids of `excess`
    (nx, ny, nz), the grey level above that of the void, in a strut of this radius; voxels.

    Weights fall as a parabola to zero at a distance of MARGIN from the surface. Of a branch as short as
    it is wide the voxels may hardly differ in their arc length, and say nothing of a curve: one that
    leaves the strut is not taken."""
    arc, reach = arc_length(line), radius + MARGIN
    voxels = _around(line, reach + 1, excess.shape)
    grey = np.clip(excess[tuple(voxels.T)], 0, None)
    inside = (arc >= bounds[0]) & (arc <= bounds[1])
    if inside.sum() <= DEGREE:
        inside[:] = True
    curve = Curve.fit(bounds, arc[inside], line[inside], np.ones(inside.sum()))
    s = along(line, voxels)
    for _ in range(ROUNDS):
        s = curve.projected(voxels, s)
        weight = grey * (1 - (np.linalg.norm(voxels - curve(s), axis=1) / reach) ** 2)
        use = (s >= bounds[0]) & (s <= bounds[1]) & (weight > 0)
        if use.sum() < LEAST:
            break
        found = Curve.fit(bounds, s[use], voxels[use], weight[use])
        if found.astray(line) > reach:
            break
        curve = found
    return curve


def _around(line: np.ndarray, reach: float, shape: tuple[int, ...]) -> np.ndarray:
    """Voxels (q, 3) of an image within `reach` of a line (k, 3)."""
    low = np.clip(np.floor(line.min(axis=0) - reach).astype(int), 0, np.array(shape) - 1)
    high = np.clip(np.ceil(line.max(axis=0) + reach).astype(int) + 1, 1, shape)
    box = np.indices(high - low).reshape(3, -1).T + low
    away, _ = cKDTree(line).query(box, distance_upper_bound=reach)
    return box[np.isfinite(away)]
