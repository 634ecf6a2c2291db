"""Which deformed element a grid point lies in: the inverse of the quadratic map, element by element.

A deformed tetrahedron lies within the hull of its Bezier points: corners, and for each edge twice
its middle node less the mean of its ends. Grid points of the box around them are tried.
"""

import numba as nb
import numpy as np

from solid_twin.solid import Tetrahedra

STEPS, CLOSE = 12, 1e-10


@nb.njit(inline="always")
def _shape(xi, n):
    """n (10,): quadratic shape functions at xi (3,)."""
    a, b, c = xi
    o = 1.0 - a - b - c
    n[0], n[1] = o * (2 * o - 1), a * (2 * a - 1)
    n[2], n[3] = b * (2 * b - 1), c * (2 * c - 1)
    n[4], n[5], n[6] = 4 * o * a, 4 * a * b, 4 * o * b
    n[7], n[8], n[9] = 4 * o * c, 4 * a * c, 4 * b * c


@nb.njit(inline="always")
def _slopes(xi, d):
    """d (10, 3): their derivatives."""
    a, b, c = xi
    o = 1.0 - a - b - c
    for j in range(3):
        d[0, j] = 1 - 4 * o
        d[7, j], d[6, j], d[4, j] = -4 * c, -4 * b, -4 * a
        d[1, j], d[2, j], d[3, j], d[5, j], d[8, j], d[9, j] = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    d[1, 0], d[2, 1], d[3, 2] = 4 * a - 1, 4 * b - 1, 4 * c - 1
    d[4, 0] += 4 * o
    d[6, 1] += 4 * o
    d[7, 2] += 4 * o
    d[5, 0], d[5, 1] = 4 * b, 4 * a
    d[8, 0], d[8, 2] = 4 * c, 4 * a
    d[9, 1], d[9, 2] = 4 * c, 4 * b


@nb.njit(cache=True)
def solve_inverse(x, y, xi, n, d):
    """xi (3,), in place, of point y (3,) in the element with nodes x (10, 3): Newton's method.

    False where it does not converge, which happens far outside only. n (10,), d (10, 3): scratch."""
    for _ in range(STEPS):
        _shape(xi, n)
        _slopes(xi, d)
        r0, r1, r2 = y
        j = np.zeros((3, 3))
        for a in range(10):
            r0 -= n[a] * x[a, 0]
            r1 -= n[a] * x[a, 1]
            r2 -= n[a] * x[a, 2]
            for i in range(3):
                for k in range(3):
                    j[i, k] += x[a, i] * d[a, k]
        c0 = j[1, 1] * j[2, 2] - j[1, 2] * j[2, 1]
        c1 = j[1, 2] * j[2, 0] - j[1, 0] * j[2, 2]
        c2 = j[1, 0] * j[2, 1] - j[1, 1] * j[2, 0]
        det = j[0, 0] * c0 + j[0, 1] * c1 + j[0, 2] * c2
        if not det > 0:
            return False
        s0 = r0 * c0 + r1 * (j[0, 2] * j[2, 1] - j[0, 1] * j[2, 2])
        s0 = (s0 + r2 * (j[0, 1] * j[1, 2] - j[0, 2] * j[1, 1])) / det
        s1 = r0 * c1 + r1 * (j[0, 0] * j[2, 2] - j[0, 2] * j[2, 0])
        s1 = (s1 + r2 * (j[0, 2] * j[1, 0] - j[0, 0] * j[1, 2])) / det
        s2 = r0 * c2 + r1 * (j[0, 1] * j[2, 0] - j[0, 0] * j[2, 1])
        s2 = (s2 + r2 * (j[0, 0] * j[1, 1] - j[0, 1] * j[1, 0])) / det
        xi[0] += s0
        xi[1] += s1
        xi[2] += s2
        size = abs(s0) + abs(s1) + abs(s2)
        if size < CLOSE:
            return True
        if size > 10.0:
            return False
    return False


@nb.njit(cache=True)
def _find(x, cells, origin, h, margin, owner, depth, local):
    """Fill owner, depth and local (`locate_grid`); the number of grid points in two elements."""
    twice = 0
    n, d = np.empty(10), np.empty((10, 3))
    node, bezier = np.empty((10, 3)), np.empty((10, 3))
    xi, y = np.empty(3), np.empty(3)
    low, high = np.empty(3, np.int64), np.empty(3, np.int64)
    ends = np.array([[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]])
    for e in range(len(cells)):
        for a in range(10):
            node[a] = x[cells[e, a]]
        bezier[:] = node
        for a in range(6):
            bezier[4 + a] = 2 * node[4 + a] - 0.5 * (node[ends[a, 0]] + node[ends[a, 1]])
        for k in range(3):
            least, most = bezier[:, k].min(), bezier[:, k].max()
            wide = margin * (most - least)
            low[k] = max(0, int(np.ceil((least - wide - origin[k]) / h)))
            high[k] = min(owner.shape[k] - 1, int(np.floor((most + wide - origin[k]) / h)))
        edges = np.empty((3, 3))
        for k in range(3):
            edges[:, k] = node[k + 1] - node[0]
        inverse = np.linalg.inv(edges)
        for i in range(low[0], high[0] + 1):
            y[0] = origin[0] + h * i
            for j in range(low[1], high[1] + 1):
                y[1] = origin[1] + h * j
                for k in range(low[2], high[2] + 1):
                    y[2] = origin[2] + h * k
                    for m in range(3):
                        xi[m] = 0.0
                        for p in range(3):
                            xi[m] += inverse[m, p] * (y[p] - node[0, p])
                    if min(xi.min(), 1 - xi.sum()) < -1.0 - margin:
                        continue
                    if not solve_inverse(node, y, xi, n, d):
                        continue
                    least = min(xi.min(), 1 - xi.sum())
                    if least > 1e-6 and depth[i, j, k] > 1e-6:
                        twice += 1
                    if least >= -margin - 1e-9 and least > depth[i, j, k]:
                        owner[i, j, k] = e
                        depth[i, j, k] = least
                        if len(local):
                            for m in range(3):
                                local[m, i, j, k] = xi[m]
    return twice


def locate_grid(
    mesh: Tetrahedra,
    x: np.ndarray,
    shape: tuple[int, int, int],
    sampling: int = 1,
    margin: float = 0.0,
    with_local: bool = False,
) -> tuple[np.ndarray, np.ndarray, int]:
    """Element (nx s, ny s, nz s) int32 of each grid point of an image, -1 for none.

    x (n, 3): deformed positions; `sampling` s: points per voxel and axis. With a `margin` points
    outside belong to an element as well, as long as no barycentric coordinate is below -margin;
    the element in which the least one is largest has the point. Returned too: the local
    coordinates (3, ...) float32 when asked for, and the number of points that lie in two elements,
    where parts of the solid have gone through each other."""
    size = tuple(sampling * n for n in shape)
    owner, depth = np.full(size, -1, np.int32), np.full(size, -np.inf, np.float32)
    local = np.zeros((3, *size) if with_local else (0, 0, 0, 0), np.float32)
    h = 1 / sampling
    origin = np.full(3, -0.5 + h / 2)
    twice = _find(x, mesh.cells, origin, h, margin, owner, depth, local)
    return owner, local, twice


def occupancy(
    mesh: Tetrahedra, x: np.ndarray, shape: tuple[int, int, int], sampling: int
) -> tuple[np.ndarray, float]:
    """Share of each voxel (nx, ny, nz) float32 that is solid; share of the solid that is there
    twice."""
    owner, _, twice = locate_grid(mesh, x, shape, sampling)
    inside = owner >= 0
    s = sampling
    blocks = inside.reshape(shape[0], s, shape[1], s, shape[2], s)
    return blocks.mean(axis=(1, 3, 5), dtype=np.float32), twice / max(int(inside.sum()), 1)
