"""Matrices between the control points of a spline grid, and the solution of their systems.

A matrix couples control points at most three apart along each axis, so it is kept as a stencil
(nx, ny, nz, 7, 7, 7, 6): for each offset the symmetric 3 x 3 block (xx, xy, xz, yy, yz, zz), in single
precision since it is the largest array there is and is solved to a few per cent; a matrix that treats
the components alike as a scalar stencil (nx, ny, nz, 7, 7, 7).
"""

from collections.abc import Callable

import numba as nb
import numpy as np

from addvc.correlation.spline_grid import SplineGrid

DIAGONAL = 0, 3, 5  # xx, yy, zz among the six entries of a block


@nb.njit(inline="always")
def _pairs(n, out):
    """The ten products N_a N_b, a <= b."""
    p = 0
    for a in range(4):
        for b in range(a, 4):
            out[p] = n[a] * n[b]
            p += 1


@nb.njit(cache=True, fastmath={"contract"})
def _flush_line(line, y, plane):
    for c in range(6):
        for p in range(10):
            for q in range(10):
                plane[c, p, q] += y[p] * line[c, q]
    line[:] = 0.0


@nb.njit(cache=True, fastmath={"contract"})
def _flush_plane(plane, x, total):
    for o in range(10):
        for c in range(6):
            for p in range(10):
                for q in range(10):
                    total[o, c, p, q] += x[o] * plane[c, p, q]
    plane[:] = 0.0


@nb.njit(cache=True, fastmath={"contract"})
def cell_dyads(basis, vectors, weight, total):
    """sum_q w g g^T N_a N_b ... of one cell by pairs: total (10, 6, 10, 10) for x, block, y, z.

    Points of one line along z, then lines of one plane, are summed before they meet the other axes:
    on a lattice of voxels this is some tenth of the work."""
    line, plane = np.zeros((6, 10)), np.zeros((6, 10, 10))
    x, y, z = np.empty(10), np.empty(10), np.empty(10)
    total[:] = 0.0
    for q in range(len(weight)):
        _pairs(basis[q, 2], z)
        g, w = vectors[q], weight[q]
        c = 0
        for i in range(3):
            for j in range(i, 3):
                f = w * g[i] * g[j]
                for p in range(10):
                    line[c, p] += f * z[p]
                c += 1
        last = q + 1 == len(weight)
        new_plane = last or basis[q + 1, 0, 0] != basis[q, 0, 0]
        if new_plane or basis[q + 1, 1, 0] != basis[q, 1, 0]:
            _pairs(basis[q, 1], y)
            _flush_line(line, y, plane)
        if new_plane:
            _pairs(basis[q, 0], x)
            _flush_plane(plane, x, total)


@nb.njit(parallel=True, cache=True)
def scatter_dyads(cells, first, basis, vectors, weight):
    """H_ab = sum_q w N_a N_b g g^T over the points, as a stencil (nx, ny, nz, 7, 7, 7, 6)."""
    nx, ny, nz = cells
    out = np.zeros((nx + 3, ny + 3, nz + 3, 7, 7, 7, 6), np.float32)
    pair = np.array([[0, 1, 2, 3], [1, 4, 5, 6], [2, 5, 7, 8], [3, 6, 8, 9]])
    for colour in range(4):
        for layer in nb.prange((nx - colour + 3) // 4):
            i = 4 * layer + colour
            total = np.empty((10, 6, 10, 10))
            for j in range(ny):
                for k in range(nz):
                    e = (i * ny + j) * nz + k
                    f, s = first[e], first[e + 1]
                    if f == s:
                        continue
                    cell_dyads(basis[f:s], vectors[f:s], weight[f:s], total)
                    _scatter_cell(total, pair, i, j, k, out)
    return out


@nb.njit(cache=True, fastmath={"contract"})
def _scatter_cell(total, pair, i, j, k, out):
    for a in range(4):
        for b in range(4):
            for c in range(4):
                row = out[i + a, j + b, k + c]
                for d in range(4):
                    for e in range(4):
                        for f in range(4):
                            block = row[3 + d - a, 3 + e - b, 3 + f - c]
                            for m in range(6):
                                block[m] += total[pair[a, d], m, pair[b, e], pair[c, f]]


@nb.njit(parallel=True, cache=True, fastmath={"contract"})
def stencil_product(stencil, x):
    """A x for a stencil (nx, ny, nz, 7, 7, 7, 6) and x (nx, ny, nz, 3)."""
    nx, ny, nz = x.shape[:3]
    out = np.zeros_like(x)
    for row in nb.prange(nx * ny):
        i, j = row // ny, row % ny
        for k in range(nz):
            y0, y1, y2 = 0.0, 0.0, 0.0
            for a in range(max(0, 3 - i), min(7, nx + 3 - i)):
                for b in range(max(0, 3 - j), min(7, ny + 3 - j)):
                    for c in range(max(0, 3 - k), min(7, nz + 3 - k)):
                        m = stencil[i, j, k, a, b, c]
                        v = x[i + a - 3, j + b - 3, k + c - 3]
                        y0 += m[0] * v[0] + m[1] * v[1] + m[2] * v[2]
                        y1 += m[1] * v[0] + m[3] * v[1] + m[4] * v[2]
                        y2 += m[2] * v[0] + m[4] * v[1] + m[5] * v[2]
            out[i, j, k, 0], out[i, j, k, 1], out[i, j, k, 2] = y0, y1, y2
    return out


def gram(cells: int, derivative: int) -> np.ndarray:
    """Integrals of products of the `derivative`-th derivatives of N_a and N_b over `cells` cells of
    length one, as bands (cells + 3, 7): column 3 + b - a."""
    s, w = np.polynomial.legendre.leggauss(4)
    t, w = (s + 1) / 2, w / 2
    cubic = [[1, -3, 3, -1], [4, 0, -6, 3], [1, 3, 3, -3], [0, 0, 0, 1]]
    pieces = [np.polynomial.Polynomial(np.array(p) / 6) for p in cubic]
    value = np.array([(p.deriv(derivative) if derivative else p)(t) for p in pieces])
    local = np.einsum("aq,bq,q->ab", value, value, w)
    bands = np.zeros((cells + 3, 7))
    for a in range(4):
        for b in range(4):
            bands[a : a + cells, 3 + b - a] += local[a, b]
    return bands


def bending(grid: SplineGrid) -> np.ndarray:
    """Integral of |grad grad u|^2 over the box (voxel^-1), a scalar stencil (nx, ny, nz, 7, 7, 7).

    It vanishes on affine fields only."""
    bands = [[gram(n, order) for order in range(3)] for n in grid.cells]
    total = np.zeros((*grid.shape, 7, 7, 7))
    for orders in np.ndindex(3, 3, 3):
        if sum(orders) != 2:
            continue
        x, y, z = (bands[d][orders[d]] for d in range(3))
        times = 1 if max(orders) == 2 else 2
        total += times * np.einsum("ia,jb,kc->ijkabc", x, y, z)
    return total / grid.spacing


def add_scalar(stencil: np.ndarray, scalar: np.ndarray, weight: float) -> None:
    """stencil += weight * scalar on each component, in place."""
    added = (weight * scalar).astype(stencil.dtype)
    for m in DIAGONAL:
        stencil[..., m] += added


def block_jacobi(stencil: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """r -> D^-1 r, both (nx, ny, nz, 3), D being the 3 x 3 blocks of the diagonal."""
    block = stencil[:, :, :, 3, 3, 3][..., [[0, 1, 2], [1, 3, 4], [2, 4, 5]]]
    inverse = np.linalg.inv(block.astype(float))
    return lambda r: np.einsum("ijkab,ijkb->ijka", inverse, r)


def conjugate_gradient(
    stencil: np.ndarray, b: np.ndarray, tolerance: float, most: int
) -> tuple[np.ndarray, int]:
    """x of A x = b (nx, ny, nz, 3) to ||b - A x|| < tolerance ||b|| in at most `most` steps, and the
    number of steps. Dot products are sums in one order, so that threads change nothing."""
    precondition = block_jacobi(stencil)
    x, r = np.zeros_like(b), b.copy()
    p = z = precondition(r)
    rz, goal = np.sum(r * z), tolerance**2 * np.sum(b * b)
    steps = 0
    while steps < most and np.sum(r * r) > goal:
        ap = stencil_product(stencil, p)
        alpha = rz / np.sum(p * ap)
        x, r = x + alpha * p, r - alpha * ap
        z = precondition(r)
        rz, before = np.sum(r * z), rz
        p = z + rz / before * p
        steps += 1
    return x, steps


@nb.njit(parallel=True, cache=True)
def scalar_product(stencil, x):
    """A x for a scalar stencil (nx, ny, nz, 7, 7, 7) and x (nx, ny, nz, 3)."""
    nx, ny, nz = x.shape[:3]
    out = np.zeros_like(x)
    for row in nb.prange(nx * ny):
        i, j = row // ny, row % ny
        for k in range(nz):
            for a in range(max(0, 3 - i), min(7, nx + 3 - i)):
                for b in range(max(0, 3 - j), min(7, ny + 3 - j)):
                    for c in range(max(0, 3 - k), min(7, nz + 3 - k)):
                        m = stencil[i, j, k, a, b, c]
                        for d in range(3):
                            out[i, j, k, d] += m * x[i + a - 3, j + b - 3, k + c - 3, d]
    return out
