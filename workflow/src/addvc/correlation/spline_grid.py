"""A displacement as a tensor product of uniform cubic B-splines: values, refinement, operators.

Along each axis the control points stand `spacing` voxels apart, one before and two after the cell
of a point being the ones that reach it: u(x) = sum_abc N_a(x) N_b(y) N_c(z) p_abc. A matrix between
control points couples neighbours at most three apart along each axis, so it is kept as a stencil
(nx, ny, nz, 7, 7, 7, 6): the symmetric 3 x 3 block (xx, xy, xz, yy, yz, zz) for each offset.
"""

from dataclasses import dataclass

import numba as nb
import numpy as np

REACH = 3  # control points along an axis that a stencil reaches on each side


@dataclass(frozen=True)
class SplineGrid:
    """Cells of `spacing` voxels from `origin` (3,), `cells` of them along each axis."""

    origin: tuple[float, float, float]
    spacing: float
    cells: tuple[int, int, int]

    @property
    def shape(self) -> tuple[int, int, int]:
        """Control points along each axis."""
        nx, ny, nz = self.cells
        return nx + 3, ny + 3, nz + 3

    def control_points(self) -> np.ndarray:
        """Where the control points stand (nx, ny, nz, 3); an affine field is its own values there."""
        lines = [
            start + self.spacing * (np.arange(n) - 1.0)
            for start, n in zip(self.origin, self.shape, strict=True)
        ]
        return np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1)

    def finer(self) -> "SplineGrid":
        """The same box with half the spacing."""
        nx, ny, nz = self.cells
        return SplineGrid(self.origin, self.spacing / 2, (2 * nx, 2 * ny, 2 * nz))


def grid_over(image_shape: tuple[int, int, int], spacing: float) -> SplineGrid:
    """The least grid in the middle of the image that holds the centres of all its voxels."""
    cells = [max(1, int(np.ceil((n - 1) / spacing))) for n in image_shape]
    origin = [(n - 1 - m * spacing) / 2 for n, m in zip(image_shape, cells, strict=True)]
    return SplineGrid(tuple(origin), float(spacing), tuple(cells))


def refine(coefficients: np.ndarray) -> np.ndarray:
    """Coefficients (nx, ny, nz, ...) on a grid -> those of the same field on the `finer` grid.

    Subdivision of cubic B-splines: (1, 6, 1) / 8 at old control points, (1, 1) / 2 between them."""
    for axis in range(3):
        c = np.moveaxis(coefficients, axis, 0)
        fine = np.empty((2 * len(c) - 3, *c.shape[1:]))
        fine[0::2] = (c[:-1] + c[1:]) / 2
        fine[1::2] = (c[:-2] + 6 * c[1:-1] + c[2:]) / 8
        coefficients = np.moveaxis(fine, 0, axis)
    return np.ascontiguousarray(coefficients)


@dataclass(frozen=True, eq=False)
class SplinePoints:
    """Points (Q, 3) in the order of the cells that hold them; `first` (cells + 1,) where each cell's
    begin; `basis` (Q, 3, 4) the four values of N along each axis."""

    points: np.ndarray
    first: np.ndarray
    basis: np.ndarray


def spline_points(grid: SplineGrid, points: np.ndarray) -> SplinePoints:
    """Sort points (Q, 3) by cell, keeping their order inside each."""
    cell, basis = locate(np.array(grid.origin), grid.spacing, np.array(grid.cells), points)
    number = np.ravel_multi_index(tuple(cell.T), grid.cells)
    order = np.argsort(number, kind="stable")
    first = np.searchsorted(number[order], np.arange(np.prod(grid.cells) + 1))
    return SplinePoints(points[order], first, basis[order])


@nb.njit(inline="always")
def _values(t, out):
    s = 1.0 - t
    out[0] = s * s * s / 6.0
    out[1] = (3.0 * t * t * t - 6.0 * t * t + 4.0) / 6.0
    out[2] = (3.0 * s * s * s - 6.0 * s * s + 4.0) / 6.0
    out[3] = t * t * t / 6.0


@nb.njit(parallel=True, cache=True)
def locate(origin, spacing, cells, points):
    """Cell (Q, 3) of each point, and the four values of N along each axis (Q, 3, 4).

    A point outside the box takes those of the nearest point of the box."""
    q = points.shape[0]
    cell, basis = np.empty((q, 3), np.int64), np.empty((q, 3, 4))
    for p in nb.prange(q):
        for d in range(3):
            s = min(max((points[p, d] - origin[d]) / spacing, 0.0), float(cells[d]))
            cell[p, d] = min(int(s), cells[d] - 1)
            _values(s - cell[p, d], basis[p, d])
    return cell, basis


def evaluate(grid: SplineGrid, coefficients: np.ndarray, points: np.ndarray) -> np.ndarray:
    """u (Q, 3) at points (Q, 3), coefficients (nx, ny, nz, 3); constant beyond the box."""
    cell, basis = locate(np.array(grid.origin), grid.spacing, np.array(grid.cells), points)
    return sum_basis(coefficients, cell, basis)


@nb.njit(parallel=True, cache=True)
def sum_basis(coefficients, cell, basis):
    """sum_abc N_a N_b N_c p_abc at points given by cell (Q, 3) and basis (Q, 3, 4): (Q, 3)."""
    out = np.zeros((cell.shape[0], 3))
    for p in nb.prange(cell.shape[0]):
        for a in range(4):
            for b in range(4):
                w = basis[p, 0, a] * basis[p, 1, b]
                for c in range(4):
                    at = coefficients[cell[p, 0] + a, cell[p, 1] + b, cell[p, 2] + c]
                    for d in range(3):
                        out[p, d] += w * basis[p, 2, c] * at[d]
    return out


@nb.njit(parallel=True, cache=True)
def scatter_vectors(cells, first, basis, vectors):
    """sum_q N_a(q) g_q over the points, (nx, ny, nz, 3): the transpose of `evaluate`.

    Layers of cells four apart share no control point: each of the four passes is parallel, and the
    order of every sum is the same whatever the number of threads."""
    nx, ny, nz = cells
    out = np.zeros((nx + 3, ny + 3, nz + 3, 3))
    for colour in range(4):
        for layer in nb.prange((nx - colour + 3) // 4):
            i = 4 * layer + colour
            for j in range(ny):
                for k in range(nz):
                    e = (i * ny + j) * nz + k
                    for q in range(first[e], first[e + 1]):
                        for a in range(4):
                            for b in range(4):
                                w = basis[q, 0, a] * basis[q, 1, b]
                                for c in range(4):
                                    at = out[i + a, j + b, k + c]
                                    for d in range(3):
                                        at[d] += w * basis[q, 2, c] * vectors[q, d]
    return out


@nb.njit(inline="always")
def _pairs(n, out):
    """The ten products N_a N_b, a <= b."""
    p = 0
    for a in range(4):
        for b in range(a, 4):
            out[p] = n[a] * n[b]
            p += 1


@nb.njit(cache=True)
def _flush_line(line, y, plane):
    for c in range(6):
        for p in range(10):
            for q in range(10):
                plane[c, p, q] += y[p] * line[c, q]
    line[:] = 0.0


@nb.njit(cache=True)
def _flush_plane(plane, x, total):
    for o in range(10):
        for c in range(6):
            for p in range(10):
                for q in range(10):
                    total[o, c, p, q] += x[o] * plane[c, p, q]
    plane[:] = 0.0


@nb.njit(cache=True)
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
    out = np.zeros((nx + 3, ny + 3, nz + 3, 7, 7, 7, 6))
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


@nb.njit(cache=True)
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


@nb.njit(parallel=True, cache=True)
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


def add_scalar(stencil: np.ndarray, scalar: np.ndarray, weight: float) -> np.ndarray:
    """stencil + weight * scalar on each component."""
    out = stencil.copy()
    for m in (0, 3, 5):
        out[..., m] += weight * scalar
    return out


def scalar_product(scalar: np.ndarray, x: np.ndarray) -> np.ndarray:
    """A x for a scalar stencil (nx, ny, nz, 7, 7, 7) and x (nx, ny, nz, 3)."""
    return scalar_stencil_product(scalar, np.ascontiguousarray(x))


@nb.njit(parallel=True, cache=True)
def scalar_stencil_product(stencil, x):
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
