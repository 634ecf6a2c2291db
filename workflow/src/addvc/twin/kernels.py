"""Compiled geometry of single beam elements: distance to the surface, motion, its inverse.

Device functions and the loops that call them stay in this one module, because the compiler's
cache does not follow changes across modules. An element's reference is straight; material
coordinates of a point X are t in [0, 1] along it and zeta = X - r0(t).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit, prange

LOBE = 0.12
"""Amplitude of the three-lobed section over its radius."""

WINDOW = 2.0
"""An element has weight exp(-3 D), D = d_e - d_min, cut off smoothly at this D (voxels)."""

BLEND = 2.0
"""Height above a platen over which its rigid motion fades into that of the struts (voxels)."""


class Beams(NamedTuple):
    """Reference of m elements, from `geometry.beams`."""

    start: np.ndarray  # (m, 3)
    chord: np.ndarray  # (m, 3) end - start
    inverse2: np.ndarray  # (m,) 1 / |chord|^2
    radii: np.ndarray  # (m, 2)
    first: np.ndarray  # (m, 3) director of a lobe
    second: np.ndarray  # (m, 3) chord direction x first


class Bent(NamedTuple):
    """One state of m elements, from `geometry.bend`."""

    ends: np.ndarray  # (m, 2, 3)
    tangents: np.ndarray  # (m, 2, 3) d r / d t at both ends
    rotation: np.ndarray  # (m, 3, 3) R_a
    twist: np.ndarray  # (m, 3) log(R_a^T R_b)
    platens: np.ndarray  # (3,) faces low, high in the reference, motion of the upper one along y


class Cells(NamedTuple):
    """Elements near each cell of a lattice: listed[first[c]:first[c + 1]]."""

    size: float
    count: np.ndarray  # (3,)
    first: np.ndarray
    listed: np.ndarray


@njit(inline="always")
def _clip(t):
    return min(max(t, 0.0), 1.0)


@njit(cache=True)
def _turn(p, e, t, x, y, z):
    """R_e(t) (x, y, z) with R_e(t) = R_a exp(t log(R_a^T R_b))."""
    a, b, c = t * p.twist[e, 0], t * p.twist[e, 1], t * p.twist[e, 2]
    x, y, z = _rodrigues(a, b, c, x, y, z)
    r = p.rotation[e]
    return (
        r[0, 0] * x + r[0, 1] * y + r[0, 2] * z,
        r[1, 0] * x + r[1, 1] * y + r[1, 2] * z,
        r[2, 0] * x + r[2, 1] * y + r[2, 2] * z,
    )


@njit(cache=True)
def _turn_back(p, e, t, x, y, z):
    """R_e(t)^T (x, y, z)."""
    r = p.rotation[e]
    u = r[0, 0] * x + r[1, 0] * y + r[2, 0] * z
    v = r[0, 1] * x + r[1, 1] * y + r[2, 1] * z
    w = r[0, 2] * x + r[1, 2] * y + r[2, 2] * z
    return _rodrigues(-t * p.twist[e, 0], -t * p.twist[e, 1], -t * p.twist[e, 2], u, v, w)


@njit(cache=True)
def _rodrigues(a, b, c, x, y, z):
    """exp of the rotation vector (a, b, c), applied to (x, y, z)."""
    q = a * a + b * b + c * c
    if q < 1e-8:
        s, k = 1.0 - q / 6.0, 0.5 - q / 24.0
    else:
        angle = np.sqrt(q)
        s, k = np.sin(angle) / angle, (1.0 - np.cos(angle)) / q
    u, v, w = b * z - c * y, c * x - a * z, a * y - b * x
    return (
        x + s * u + k * (b * w - c * v),
        y + s * v + k * (c * u - a * w),
        z + s * w + k * (a * v - b * u),
    )


@njit(cache=True)
def _centre_line(p, e, t):
    """r_e(t): cubic Hermite through the deformed ends with their tangents."""
    t2, t3 = t * t, t * t * t
    h0, h1, h2, h3 = 2 * t3 - 3 * t2 + 1, 3 * t2 - 2 * t3, t3 - 2 * t2 + t, t3 - t2
    n, m = p.ends[e], p.tangents[e]
    return (
        h0 * n[0, 0] + h1 * n[1, 0] + h2 * m[0, 0] + h3 * m[1, 0],
        h0 * n[0, 1] + h1 * n[1, 1] + h2 * m[0, 1] + h3 * m[1, 1],
        h0 * n[0, 2] + h1 * n[1, 2] + h2 * m[0, 2] + h3 * m[1, 2],
    )


@njit(cache=True)
def _segment2(p, e, x, y, z):
    """Squared distance to the segment between the deformed ends."""
    n = p.ends[e]
    a, b, c = n[1, 0] - n[0, 0], n[1, 1] - n[0, 1], n[1, 2] - n[0, 2]
    x, y, z = x - n[0, 0], y - n[0, 1], z - n[0, 2]
    t = _clip((x * a + y * b + z * c) / (a * a + b * b + c * c + 1e-12))
    x, y, z = x - t * a, y - t * b, z - t * c
    return x * x + y * y + z * z


@njit(cache=True)
def _carry(p, e, t, x, y, z):
    """r_e(t) + R_e(t) zeta: where element e takes a material point."""
    u, v, w = _turn(p, e, t, x, y, z)
    a, b, c = _centre_line(p, e, t)
    return a + u, b + v, c + w


@njit(cache=True)
def _surface(b, e, t, x, y, z):
    """Signed distance |zeta| - radius(t, angle); cos(3 angle) as a harmonic of zeta."""
    n2 = x * x + y * y + z * z
    n = np.sqrt(n2)
    radius = (1.0 - t) * b.radii[e, 0] + t * b.radii[e, 1]
    f, s = b.first[e], b.second[e]
    u = x * f[0] + y * f[1] + z * f[2]
    v = x * s[0] + y * s[1] + z * s[2]
    return n - radius * (1.0 + LOBE * u * (u * u - 3.0 * v * v) / (n2 * n + 1e-9))


@njit(cache=True)
def _material(b, e, x, y, z):
    """Material coordinates of a reference point -> t, zeta."""
    s, c = b.start[e], b.chord[e]
    x, y, z = x - s[0], y - s[1], z - s[2]
    t = _clip((x * c[0] + y * c[1] + z * c[2]) * b.inverse2[e])
    return t, x - t * c[0], y - t * c[1], z - t * c[2]


@njit(cache=True)
def _pull_back(b, p, e, x, y, z):
    """Material coordinates of a deformed point under the motion of element e alone.

    Newton for chord . R(t)^T (x - r(t)) = 0, whose slope is close to -|chord|^2.
    """
    c = b.chord[e]
    t = 0.5
    for _ in range(4):
        r0, r1, r2 = _centre_line(p, e, t)
        u, v, w = _turn_back(p, e, t, x - r0, y - r1, z - r2)
        step = (u * c[0] + v * c[1] + w * c[2]) * b.inverse2[e]
        t = _clip(t + step)
        if abs(step) < 1e-3:
            break
    r0, r1, r2 = _centre_line(p, e, t)
    u, v, w = _turn_back(p, e, t, x - r0, y - r1, z - r2)
    return t, u, v, w


@njit(cache=True)
def _cell(cells, x, y, z):
    """Number of the lattice cell of a point; points outside belong to the nearest cell."""
    n = cells.count
    i = min(max(int((x + 0.5) / cells.size), 0), n[0] - 1)
    j = min(max(int((y + 0.5) / cells.size), 0), n[1] - 1)
    k = min(max(int((z + 0.5) / cells.size), 0), n[2] - 1)
    return (i * n[1] + j) * n[2] + k


@njit(cache=True)
def _nearest(b, near, x, y, z, distances):
    """Fill distances to the elements listed in near -> position of the nearest, or -1."""
    best = -1
    for q in range(len(near)):
        t, u, v, w = _material(b, near[q], x, y, z)
        distances[q] = _surface(b, near[q], t, u, v, w)
        if best < 0 or distances[q] < distances[best]:
            best = q
    return best


@njit(cache=True)
def _blend(b, p, near, x, y, z, distances):
    """Deformed place of a reference point: mean over near elements, then over the platens."""
    best = _nearest(b, near, x, y, z, distances)
    total, sx, sy, sz = 0.0, 0.0, 0.0, 0.0
    for q in range(len(near)):
        gap = (distances[q] - distances[best]) / WINDOW
        if gap < 1.0:
            weight = np.exp(-3.0 * WINDOW * gap) * (1.0 - gap * gap) ** 2
            t, u, v, w = _material(b, near[q], x, y, z)
            u, v, w = _carry(p, near[q], t, u, v, w)
            total += weight
            sx, sy, sz = sx + weight * u, sy + weight * v, sz + weight * w
    sx, sy, sz = sx / total, sy / total, sz / total
    low = _clip(1.0 - (y - p.platens[0]) / BLEND)
    high = _clip(1.0 - (p.platens[1] - y) / BLEND)
    own = 1.0 - low - high
    return (
        own * sx + (low + high) * x,
        own * sy + (low + high) * y + high * p.platens[2],
        own * sz + (low + high) * z,
    )


@njit(parallel=True, cache=True)
def place(b, p, cells, cell_of, points):
    """Deformed places (n, 3) of reference points (n, 3); cell_of (n,) indexes cells."""
    out = np.empty_like(points)
    widest = np.max(cells.first[1:] - cells.first[:-1])
    blocks = 64
    for block in prange(blocks):
        distances = np.empty(widest)
        for i in range(block * len(points) // blocks, (block + 1) * len(points) // blocks):
            near = cells.listed[cells.first[cell_of[i]] : cells.first[cell_of[i] + 1]]
            x, y, z = points[i]
            out[i, 0], out[i, 1], out[i, 2] = _blend(b, p, near, x, y, z, distances)
    return out


@njit(parallel=True, cache=True)
def closest(b, cells, cell_of, points):
    """Nearest element (n,) of points (n, 3) and the distance (n,) to its surface."""
    element, out = np.empty(len(points), np.int32), np.empty(len(points))
    widest = np.max(cells.first[1:] - cells.first[:-1])
    blocks = 64
    for block in prange(blocks):
        distances = np.empty(widest)
        for i in range(block * len(points) // blocks, (block + 1) * len(points) // blocks):
            near = cells.listed[cells.first[cell_of[i]] : cells.first[cell_of[i] + 1]]
            best = _nearest(b, near, points[i, 0], points[i, 1], points[i, 2], distances)
            element[i], out[i] = near[best], distances[best]
    return element, out


@njit(parallel=True, cache=True)
def cells_of(cells, points):
    """Number of the cell (n,) of each of points (n, 3)."""
    out = np.empty(len(points), np.int64)
    for i in prange(len(points)):
        out[i] = _cell(cells, points[i, 0], points[i, 1], points[i, 2])
    return out


@njit(cache=True)
def visit_cells(b, size, count, reach, first, listed):
    """Elements whose surface is within reach of a cell. Counts into first if listed is empty."""
    half = 0.5 * size * np.sqrt(3.0)
    for e in range(len(b.start)):
        thick = max(b.radii[e, 0], b.radii[e, 1]) * (1.0 + LOBE) + half + reach
        lo, hi = np.empty(3, np.int64), np.empty(3, np.int64)
        for d in range(3):
            s, c = b.start[e, d], b.chord[e, d]
            lo[d] = max(int((min(s, s + c) - thick + 0.5) / size), 0)
            hi[d] = min(int((max(s, s + c) + thick + 0.5) / size) + 1, count[d])
        for i in range(lo[0], hi[0]):
            for j in range(lo[1], hi[1]):
                for k in range(lo[2], hi[2]):
                    x, y, z = (i + 0.5) * size - 0.5, (j + 0.5) * size - 0.5, (k + 0.5) * size - 0.5
                    _, u, v, w = _material(b, e, x, y, z)
                    if u * u + v * v + w * w < thick * thick:
                        cell = (i * count[1] + j) * count[2] + k
                        if len(listed) > 0:
                            listed[first[cell]] = e
                        first[cell] += 1


@njit(parallel=True, cache=True)
def scatter(b, p, boxes, reach, origin, h, band, distance, owner):
    """Distance to the union of deformed elements on a grid of spacing h: the least of all.

    boxes (m, 2, 3): bounds of the elements; reach (m,): how far from the segment between its ends
    an element may come within the band; grid point (i, j, k) lies at origin + h (i, j, k).
    distance (float32) and owner (int32) are filled where an element is nearer than band.
    """
    nx, ny, nz = distance.shape
    for chunk in prange((nx + 3) // 4):
        for e in range(len(boxes)):
            i0 = max(int(np.ceil((boxes[e, 0, 0] - origin[0]) / h)), 4 * chunk)
            i1 = min(int(np.floor((boxes[e, 1, 0] - origin[0]) / h)) + 1, 4 * chunk + 4, nx)
            if i0 >= i1:
                continue
            j0 = max(int(np.ceil((boxes[e, 0, 1] - origin[1]) / h)), 0)
            j1 = min(int(np.floor((boxes[e, 1, 1] - origin[1]) / h)) + 1, ny)
            k0 = max(int(np.ceil((boxes[e, 0, 2] - origin[2]) / h)), 0)
            k1 = min(int(np.floor((boxes[e, 1, 2] - origin[2]) / h)) + 1, nz)
            for i in range(i0, i1):
                for j in range(j0, j1):
                    for k in range(k0, k1):
                        x, y, z = origin[0] + h * i, origin[1] + h * j, origin[2] + h * k
                        if _segment2(p, e, x, y, z) > reach[e] * reach[e]:
                            continue
                        t, u, v, w = _pull_back(b, p, e, x, y, z)
                        d = _surface(b, e, t, u, v, w)
                        if d < band and d < distance[i, j, k]:
                            distance[i, j, k], owner[i, j, k] = d, e


@njit(parallel=True, cache=True)
def refine(b, p, cells, origin, h, band, distance, owner):
    """Near the surface, replace the distance by that of the preimage under the blended motion.

    The preimage X of x solves blend(X) = x, by X += R^T (x - blend(X)) from the owner's own.
    """
    nx, ny, nz = distance.shape
    widest = np.max(cells.first[1:] - cells.first[:-1])
    for i in prange(nx):
        scratch = np.empty(widest)
        for j in range(ny):
            for k in range(nz):
                e = owner[i, j, k]
                if e < 0 or abs(distance[i, j, k]) > band:
                    continue
                x, y, z = origin[0] + h * i, origin[1] + h * j, origin[2] + h * k
                t, u, v, w = _pull_back(b, p, e, x, y, z)
                s, c = b.start[e], b.chord[e]
                u, v, w = s[0] + t * c[0] + u, s[1] + t * c[1] + v, s[2] + t * c[2] + w
                for _ in range(4):
                    cell = _cell(cells, u, v, w)
                    near = cells.listed[cells.first[cell] : cells.first[cell + 1]]
                    if len(near) == 0:
                        break
                    f, g, q = _blend(b, p, near, u, v, w, scratch)
                    f, g, q = x - f, y - g, z - q
                    miss = f * f + g * g + q * q
                    f, g, q = _turn_back(p, e, t, f, g, q)
                    u, v, w = u + f, v + g, w + q
                    if miss < 1e-4:
                        break
                cell = _cell(cells, u, v, w)
                near = cells.listed[cells.first[cell] : cells.first[cell + 1]]
                best = _nearest(b, near, u, v, w, scratch)
                if best >= 0 and miss < 0.04:
                    distance[i, j, k] = scratch[best]


@njit(parallel=True, cache=True)
def block_occupancy(distance, h, s, out):
    """Mean over s^3 grid points of clip(1/2 - d / h, 0, 1), into out (grid shape / s)."""
    nx, ny, nz = out.shape
    for i in prange(nx):
        for j in range(ny):
            for k in range(nz):
                total = 0.0
                for a in range(s):
                    for c in range(s):
                        for d in range(s):
                            q = distance[i * s + a, j * s + c, k * s + d]
                            total += _clip(0.5 - q / h)
                out[i, j, k] = total / s**3
