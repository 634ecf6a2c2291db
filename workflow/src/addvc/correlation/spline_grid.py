"""A displacement as a tensor product of uniform cubic B-splines: values, refinement, operators.

Along each axis the control points stand `spacing` voxels apart, one before and two after the cell
of a point being the ones that reach it: u(x) = sum_abc N_a(x) N_b(y) N_c(z) p_abc.
"""

from dataclasses import dataclass

import numba as nb
import numpy as np


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
    """Points (Q, 3) in the order of the cells (Q, 3) that hold them; `first` (cells + 1,) where each
    cell's begin; `basis` (Q, 3, 4) the four values of N along each axis."""

    points: np.ndarray
    cell: np.ndarray
    first: np.ndarray
    basis: np.ndarray


def spline_points(grid: SplineGrid, points: np.ndarray) -> SplinePoints:
    """Sort points (Q, 3) by cell, keeping their order inside each."""
    cell, basis = locate(np.array(grid.origin), grid.spacing, np.array(grid.cells), points)
    number = np.ravel_multi_index(tuple(cell.T), grid.cells)
    order = np.argsort(number, kind="stable")
    first = np.searchsorted(number[order], np.arange(np.prod(grid.cells) + 1))
    return SplinePoints(points[order], cell[order], first, basis[order])


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


@nb.njit(parallel=True, cache=True, fastmath={"contract"})
def sum_basis(coefficients, cell, basis):
    """sum_abc N_a N_b N_c p_abc at points given by cell (Q, 3) and basis (Q, 3, 4): (Q, 3)."""
    out = np.zeros((cell.shape[0], 3))
    for p in nb.prange(cell.shape[0]):
        x, y, z = 0.0, 0.0, 0.0
        for a in range(4):
            for b in range(4):
                w = basis[p, 0, a] * basis[p, 1, b]
                line = coefficients[np.uint64(cell[p, 0] + a), np.uint64(cell[p, 1] + b)]
                for c in range(4):
                    at, share = np.uint64(cell[p, 2] + c), w * basis[p, 2, c]
                    x += share * line[at, 0]
                    y += share * line[at, 1]
                    z += share * line[at, 2]
        out[p, 0], out[p, 1], out[p, 2] = x, y, z
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
