"""Contact of the struts with the platens and with each other, by penalties.

Two beams push each other apart along the shortest line between their axes where that is shorter
than the sum of their guards, GUARD times their radii; a platen pushes the nodes that would enter it.
W = k/2 gap^2 where the gap is negative, without friction. Nodes clamped to a platen, and beams that
are neighbours in the reference (struts around a junction), do not push. The derivative of the gap is
exact, as the ends of the shortest line are stationary; so is its curvature.

Spheres strung along the struts were tried first: struts then slide over each other's beads, which
took twice as many steps.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from scipy.spatial import cKDTree

GUARD = 1.2
"""Radius of a guard over that of its beam: what the penalty lets in does not overlap."""

APART = 1.6
"""Beams nearer than this, over the sum of their guards, in the reference are neighbours."""

SKIN = 1.5
"""Pairs are kept that come to touch within this distance (voxels)."""

STIFFNESS = 0.5
"""Of the penalty: force per voxel and voxel of mean radius, Young's modulus one."""


class Guards(NamedTuple):
    """Of m beams: their nodes (m, 2) and guards (m,) in voxels."""

    elements: np.ndarray
    radius: np.ndarray
    stiffness: float


class Platens(NamedTuple):
    """How near nodes come to the platen faces: their radius, or less where they start nearer."""

    low: np.ndarray  # (n,)
    high: np.ndarray  # (n,)
    stiffness: float


def guards(elements: np.ndarray, radii: np.ndarray) -> Guards:
    """Guards of elements (m, 2) with radii (m, 2) at their ends."""
    return Guards(elements, GUARD * radii.mean(axis=1), STIFFNESS * radii.mean())


def platens(
    elements: np.ndarray, radii: np.ndarray, reference: np.ndarray, faces: tuple[float, float]
) -> Platens:
    """Of the nodes (n, 3) of the reference, between the faces (low, high) of its platens."""
    radius = np.zeros(len(reference))
    np.maximum.at(radius, elements, radii)
    low = np.clip(reference[:, 1] - faces[0], 0, radius)
    return Platens(low, np.clip(faces[1] - reference[:, 1], 0, radius), STIFFNESS * radii.mean())


def near_pairs(g: Guards, reference: np.ndarray, positions: np.ndarray) -> np.ndarray:
    """Pairs (p, 2) of beams that touch, or will when they come nearer by SKIN; sorted.

    reference, positions (n, 3): nodes at rest and now."""
    ends = positions[g.elements]
    half = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).max() / 2
    reach = 2 * (half + g.radius.max()) + SKIN
    pairs = cKDTree(ends.mean(axis=1)).query_pairs(reach, output_type="ndarray")
    pairs = np.sort(pairs, axis=1).astype(np.int32)
    sums = g.radius[pairs].sum(axis=1)
    pairs = pairs[distances(g.elements, pairs, positions) < sums + SKIN]
    sums = g.radius[pairs].sum(axis=1)
    pairs = pairs[distances(g.elements, pairs, reference) > APART * sums]
    return pairs[np.lexsort(pairs.T[::-1])]


@njit(cache=True)
def _clip(x):
    return min(max(x, 0.0), 1.0)


@njit(cache=True)
def shortest(a, b, positions, d):
    """Shortest line between the axes of beams with nodes a (2,) and b (2,): shares along them of its
    ends, which go with the line, from a to b, in d (3,). After [Ericson2005], 5.1.9."""
    aa, bb, ab, ar, br = 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(3):
        u = positions[a[1], k] - positions[a[0], k]
        v = positions[b[1], k] - positions[b[0], k]
        r = positions[a[0], k] - positions[b[0], k]
        aa, bb, ab, ar, br = aa + u * u, bb + v * v, ab + u * v, ar + u * r, br + v * r
    det = aa * bb - ab * ab
    s = _clip((ab * br - ar * bb) / det) if det > 1e-9 * aa * bb else 0.5
    t = (ab * s + br) / bb
    if t < 0.0 or t > 1.0:
        t = _clip(t)
        s = _clip((ab * t - ar) / aa)
    square = 0.0
    for k in range(3):
        d[k] = (1.0 - t) * positions[b[0], k] + t * positions[b[1], k]
        d[k] -= (1.0 - s) * positions[a[0], k] + s * positions[a[1], k]
        square += d[k] * d[k]
    return s, t, np.sqrt(square)


@njit(cache=True)
def distances(elements, pairs, positions):
    """(p,) distances of the axes of pairs (p, 2) of beams."""
    out, d = np.empty(len(pairs)), np.empty(3)
    for p in range(len(pairs)):
        _, _, out[p] = shortest(elements[pairs[p, 0]], elements[pairs[p, 1]], positions, d)
    return out


@njit(cache=True)
def pair_energy(g, pairs, positions):
    """W of all pairs."""
    total, d = 0.0, np.empty(3)
    for p in range(len(pairs)):
        a, b = pairs[p]
        _, _, distance = shortest(g.elements[a], g.elements[b], positions, d)
        gap = distance - g.radius[a] - g.radius[b]
        if gap < 0.0:
            total += 0.5 * g.stiffness * gap * gap
    return total


@njit(cache=True)
def pair_tangent(g, pairs, positions, gradient, blocks):
    """Adds to gradient (n, 6); W'' of each pair by its four nodes into blocks (p, 4, 3, 4, 3)."""
    d, slope, curved = np.empty(3), np.empty((4, 3)), np.empty((4, 3, 4, 3))
    for p in range(len(pairs)):
        a, b = g.elements[pairs[p, 0]], g.elements[pairs[p, 1]]
        s, t, distance = shortest(a, b, positions, d)
        gap = distance - g.radius[pairs[p, 0]] - g.radius[pairs[p, 1]]
        blocks[p] = 0.0
        if gap >= 0.0:
            continue
        weights = (s - 1.0, -s, 1.0 - t, t)
        for n in range(4):
            node = a[n] if n < 2 else b[n - 2]
            for i in range(3):
                slope[n, i] = weights[n] * d[i] / distance
                gradient[node, i] += g.stiffness * gap * slope[n, i]
        half_square(a, b, positions, s, t, d, weights, curved)
        slack = gap / distance
        for n in range(4):
            for i in range(3):
                for m in range(4):
                    for j in range(3):
                        blocks[p, n, i, m, j] = g.stiffness * (
                            (1.0 - slack) * slope[n, i] * slope[m, j] + slack * curved[n, i, m, j]
                        )


@njit(cache=True)
def half_square(a, b, positions, s, t, d, weights, curved):
    """Second derivative of distance^2 / 2 by the four nodes, into curved (4, 3, 4, 3).

    As the ends of the shortest line move with the nodes, those that are not held at the end of a
    beam are eliminated: F'' = D_xx - D_xs D_ss^-1 D_sx."""
    u, v = np.empty(3), np.empty(3)
    uu, vv, uv = 0.0, 0.0, 0.0
    by_s, by_t = np.zeros((4, 3)), np.zeros((4, 3))
    for i in range(3):
        u[i], v[i] = (
            positions[a[1], i] - positions[a[0], i],
            positions[b[1], i] - positions[b[0], i],
        )
        uu, vv, uv = uu + u[i] * u[i], vv + v[i] * v[i], uv + u[i] * v[i]
        for n in range(4):
            by_s[n, i], by_t[n, i] = -weights[n] * u[i], weights[n] * v[i]
        by_s[0, i], by_s[1, i] = by_s[0, i] + d[i], by_s[1, i] - d[i]
        by_t[2, i], by_t[3, i] = by_t[2, i] - d[i], by_t[3, i] + d[i]
    free_s, free_t = 0.0 < s < 1.0, 0.0 < t < 1.0
    if free_s and free_t:
        det = uu * vv - uv * uv
        if det > 1e-6 * uu * vv:
            ss, tt, st = vv / det, uu / det, uv / det
        else:
            ss, tt, st = 1.0 / uu, 0.0, 0.0
    else:
        ss, tt, st = (1.0 / uu if free_s else 0.0), (1.0 / vv if free_t else 0.0), 0.0
    for n in range(4):
        for i in range(3):
            for m in range(4):
                for j in range(3):
                    curved[n, i, m, j] = (weights[n] * weights[m] if i == j else 0.0) - (
                        ss * by_s[n, i] * by_s[m, j]
                        + tt * by_t[n, i] * by_t[m, j]
                        + st * (by_s[n, i] * by_t[m, j] + by_t[n, i] * by_s[m, j])
                    )


@njit(cache=True)
def platen_energy(p, faces, positions):
    """W of the nodes (n, 3) against the faces (2,): low, high."""
    total = 0.0
    for a in range(len(positions)):
        low = positions[a, 1] - faces[0] - p.low[a]
        high = faces[1] - positions[a, 1] - p.high[a]
        total += 0.5 * p.stiffness * (min(low, 0.0) ** 2 + min(high, 0.0) ** 2)
    return total


@njit(cache=True)
def platen_tangent(p, faces, positions, gradient, stiff):
    """Adds to gradient (n, 6); stiff (n,): W'' by y of each node."""
    for a in range(len(positions)):
        low = positions[a, 1] - faces[0] - p.low[a]
        high = faces[1] - positions[a, 1] - p.high[a]
        stiff[a] = 0.0
        if low < 0.0:
            gradient[a, 1] += p.stiffness * low
            stiff[a] += p.stiffness
        if high < 0.0:
            gradient[a, 1] -= p.stiffness * high
            stiff[a] += p.stiffness


def platen_forces(p: Platens, faces: np.ndarray, positions: np.ndarray) -> np.ndarray:
    """(2,) forces along y of the lower and the upper face on the nodes that touch them."""
    low = np.minimum(positions[:, 1] - faces[0] - p.low, 0)
    high = np.minimum(faces[1] - positions[:, 1] - p.high, 0)
    return p.stiffness * np.array([-low.sum(), high.sum()])


def count(
    g: Guards, p: Platens, pairs: np.ndarray, positions: np.ndarray, faces: np.ndarray
) -> int:
    """Number of pairs of beams, and of nodes and platens, that push."""
    touching = distances(g.elements, pairs, positions) < g.radius[pairs].sum(axis=1)
    low = positions[:, 1] - faces[0] < p.low
    high = faces[1] - positions[:, 1] < p.high
    return int(touching.sum() + low.sum() + high.sum())
