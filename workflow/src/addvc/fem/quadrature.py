"""Where a functional is evaluated: an element and its points. The same kernels serve every mesh.

Micro meshes use Gauss points; meso meshes one point of each voxel whose centre is inside an element, so
that the voxels are shared out without overlap or gap; the hexahedral grid finds them by its lattice.
"""

from dataclasses import dataclass

import numba as nb
import numpy as np

from addvc.errors import MeshError
from addvc.fem.elements import gauss_tet, hex_q1, tet_p1
from addvc.fem.mesh import Mesh, cell_volumes


@dataclass(frozen=True, eq=False)
class Quadrature:
    """Q points in cells: cell (Q,) int32, shape (Q, a) = N_a there, points (Q, 3), weight (Q,)."""

    cell: np.ndarray
    shape: np.ndarray
    points: np.ndarray
    weight: np.ndarray

    def __len__(self) -> int:
        return len(self.cell)


def gauss_points(mesh: Mesh, per_tet: int = 4) -> Quadrature:
    """Gauss points of a tetrahedral mesh, weights in voxel^3."""
    xi, weights = gauss_tet(per_tet)
    shape, _ = tet_p1(xi)
    points = np.einsum("qa,eai->eqi", shape, mesh.points[mesh.cells]).reshape(-1, 3)
    weight = (6 * cell_volumes(mesh)[:, None] * weights).ravel()
    cell = np.repeat(np.arange(len(mesh.cells), dtype=np.int32), len(xi))
    return Quadrature(cell, np.tile(shape, (len(mesh.cells), 1)), points, weight)


def thinned(quadrature: Quadrature, most: int) -> Quadrature:
    """One in so many points that about `most` are left; the sum of the weights stays what it is."""
    stride = max(1, round(len(quadrature) / most))
    cell, shape, points, weight = (
        part[::stride]
        for part in (quadrature.cell, quadrature.shape, quadrature.points, quadrature.weight)
    )
    return Quadrature(cell, shape, points, weight * (quadrature.weight.sum() / weight.sum()))


def voxel_points(
    mesh: Mesh,
    image_shape: tuple[int, int, int],
    stride: int = 1,
    chosen: np.ndarray | None = None,
    dithered: bool = False,
) -> Quadrature:
    """Centres of the voxels inside a tetrahedral mesh, each owned by one cell, weight 1.

    With a `stride` one voxel in stride**3 is kept and weighs as much; of these only the `chosen`
    ones, bool of `image_shape`. `dithered`: not the centre of each but a point of it (`dither`), which
    may lie beyond its cell by as little. Raises MeshError when no voxel is inside."""
    owner = voxel_owner(mesh.points, mesh.cells, np.asarray(image_shape, dtype=np.int64))
    if chosen is not None:
        owner[~chosen] = -1
    kept = (slice(None, None, stride),) * 3
    index = np.flatnonzero(owner[kept].ravel() >= 0)
    if len(index) == 0:
        raise MeshError(
            f"no voxel that counts of the image {tuple(image_shape)} is inside the mesh, which "
            f"spans {mesh.points.min(0)} to {mesh.points.max(0)}; check the units"
        )
    cell = owner[kept].ravel()[index]
    points = np.empty((len(index), 3))
    for d, place in enumerate(np.unravel_index(index, owner[kept].shape)):
        points[:, d] = stride * place
    if dithered:
        points = dither(points, image_shape)
    shape = barycentric(mesh, cell, points)
    return Quadrature(cell, shape, points, np.full(len(index), float(stride**3)))


def dither(centres: np.ndarray, image_shape: tuple[int, int, int]) -> np.ndarray:
    """A point of each voxel, given its centre (Q, 3), such that together they fill a voxel evenly.

    The spline of Eq. 4 depends a little on where in a voxel it is taken: where an image has moved by
    half a voxel, all centres along a flat face, such as a platen's, err alike. Points spread over
    their voxels do not. Additive recurrence R3 [Roberts 2018] by the number of the voxel; no point
    leaves the image."""
    ratio = 1.2207440846057596  # g**4 = g + 1
    step = ratio ** -np.arange(1.0, 4.0)
    number = (centres[:, 0] * image_shape[1] + centres[:, 1]) * image_shape[2] + centres[:, 2]
    moved = np.empty_like(centres)
    for d, last in enumerate(np.array(image_shape) - 1.0):
        moved[:, d] = np.clip(centres[:, d] + number * step[d] % 1 - 0.5, 0, last)
    return moved


def barycentric(mesh: Mesh, cell: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Eq. A1: N (Q, 4) at points (Q, 3) of the given tetrahedra (Q,); negative when outside."""
    few = len(cell) < len(mesh.cells)  # then invert for each point, not for each cell
    cells, row = (mesh.cells[cell], np.arange(len(cell))) if few else (mesh.cells, cell)
    origin = mesh.points[cells[:, 0]]
    inverse = np.linalg.inv(mesh.points[cells[:, 1:]] - origin[:, None])  # rows: x = xi @ edges
    return cell_coordinates(origin, inverse, row, points)


@nb.njit(parallel=True, cache=True)
def cell_coordinates(origin, inverse, cell, points):
    """1 - sum xi and xi = (x - origin) @ inverse in the cell of each point, (Q, 4)."""
    out = np.empty((len(cell), 4))
    for q in nb.prange(len(cell)):
        e, total = cell[q], 0.0
        for j in range(3):
            xi = 0.0
            for i in range(3):
                xi += (points[q, i] - origin[e, i]) * inverse[e, i, j]
            out[q, 1 + j] = xi
            total += xi
        out[q, 0] = 1 - total
    return out


@nb.njit(cache=True)
def voxel_owner(points, cells, shape):
    """Volume (nx, ny, nz) int32 of the tetrahedron that owns each voxel centre, -1 for none.

    A centre on a shared face goes to the cell with the smaller number."""
    owner = np.full((shape[0], shape[1], shape[2]), -1, np.int32)
    for e in range(cells.shape[0]):
        p0 = points[cells[e, 0]]
        edge = np.empty((3, 3))
        for a in range(3):
            edge[:, a] = points[cells[e, a + 1]] - p0
        inverse = np.linalg.inv(edge)
        low, high = np.empty(3, np.int64), np.empty(3, np.int64)
        for d in range(3):
            lo, hi = p0[d], p0[d]
            for a in range(1, 4):
                lo, hi = min(lo, points[cells[e, a], d]), max(hi, points[cells[e, a], d])
            low[d], high[d] = max(0, int(np.ceil(lo))), min(shape[d] - 1, int(np.floor(hi)))
        for i in range(low[0], high[0] + 1):
            for j in range(low[1], high[1] + 1):
                for k in range(low[2], high[2] + 1):
                    if owner[i, j, k] >= 0:
                        continue
                    x, y, z = i - p0[0], j - p0[1], k - p0[2]
                    a = inverse[0, 0] * x + inverse[0, 1] * y + inverse[0, 2] * z
                    b = inverse[1, 0] * x + inverse[1, 1] * y + inverse[1, 2] * z
                    c = inverse[2, 0] * x + inverse[2, 1] * y + inverse[2, 2] * z
                    if a >= -1e-10 and b >= -1e-10 and c >= -1e-10 and a + b + c <= 1 + 1e-10:
                        owner[i, j, k] = e
    return owner


def locate_in_lattice(lines: list[np.ndarray], points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cell (Q,) and shape functions (Q, 8) of points (Q, 3) in a grid given by its grid lines.

    Cells are numbered as `geometry.grid.hex_grid` does (last axis fastest); a point outside is
    extrapolated from the nearest cell."""
    local, cell = np.empty_like(points), np.zeros(len(points), dtype=np.int64)
    for d, line in enumerate(lines):
        e = np.clip(np.searchsorted(line, points[:, d], side="right") - 1, 0, len(line) - 2)
        local[:, d] = 2 * (points[:, d] - line[e]) / (line[e + 1] - line[e]) - 1
        cell = cell * (len(line) - 1) + e
    return cell.astype(np.int32), hex_q1(local)[0]


def lattice_points(
    lines: list[np.ndarray], image_shape: tuple[int, int, int], stride: int = 1
) -> Quadrature:
    """Voxel centres (Q, 3) inside a rectilinear hexahedral grid, shape functions (Q, 8), weights as in
    `voxel_points`, stride**3 voxels.

    `lines`: rising coordinates (k,), voxels, of the grid lines along x, y and z."""
    spans = [
        np.arange(max(0, int(np.ceil(line[0]))), min(size - 1, int(line[-1])) + 1.0, stride)
        for line, size in zip(lines, image_shape, strict=True)
    ]
    points = np.stack(np.meshgrid(*spans, indexing="ij"), axis=-1).reshape(-1, 3)
    cell, shape = locate_in_lattice(lines, points)
    return Quadrature(cell, shape, points, np.full(len(points), float(stride**3)))


@nb.njit(parallel=True, cache=True)
def interpolate(cells, cell, shape, field):
    """Field (n, 3) at the quadrature points: (Q, 3)."""
    out = np.zeros((cell.shape[0], 3))
    for q in nb.prange(cell.shape[0]):
        for a in range(shape.shape[1]):
            node = cells[cell[q], a]
            for d in range(3):
                out[q, d] += shape[q, a] * field[node, d]
    return out
