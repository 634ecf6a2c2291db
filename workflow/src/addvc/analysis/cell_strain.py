"""Strain at the scale of a cell: the foam as a continuum.

At each point of a grid the displacement of the solid around it is fitted by an affine one, weighted with
its volume and with a smooth window that is a cell wide at half of its height, as is done for atoms
(Zimmerman et al., Int. J. Solids Struct. 46 (2009) 238). What the solid does within the window,
bending above all, is averaged out.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

SPACING = 0.25
"""Of the grid, in cell sizes."""

OFF_CENTRE = 0.25
"""How far the middle of the solid in a window may be from its point, in cell sizes: it is by 0.27 on a
plane face of a solid, and beyond the faces there is no strain of a cell."""

LEAST_VALID = 0.5
"""Share of the solid in a window that must be valid."""

FLAT = 0.05
"""Least over greatest eigenvalue of the second moments of the solid in a window: below, it lies in a
plane or on a line, which have no gradient across them."""

COMPONENTS = ("xx", "yy", "zz", "yz", "xz", "xy")
COLUMNS = {
    **dict.fromkeys(
        "xyz", ("voxel", "point of the grid, middle of a window one cell wide, at rest")
    ),
    "axial_strain": ("–", "stretch along the loading axis less 1"),
    **dict.fromkeys([f"e_{name}" for name in COMPONENTS], ("–", "Green-Lagrange strain")),
    "volume_ratio": ("–", "volume over that at rest"),
}
PAIRS = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))


@dataclass(frozen=True, eq=False)
class CellStrain:
    """Displacement gradient (nx, ny, nz, 3, 3) at the points of a regular grid, nan where unknown;
    `origin` (3,) and `spacing` in voxels."""

    gradient: np.ndarray
    origin: np.ndarray
    spacing: float

    @property
    def points(self) -> np.ndarray:
        """(nx, ny, nz, 3), voxels."""
        return self.origin + self.spacing * np.moveaxis(np.indices(self.gradient.shape[:3]), 0, -1)

    @property
    def green_lagrange(self) -> np.ndarray:
        """(nx, ny, nz, 3, 3): (H + H^T + H^T H) / 2, which no rotation changes."""
        h = self.gradient
        return (h + h.swapaxes(-1, -2) + h.swapaxes(-1, -2) @ h) / 2

    @property
    def volume_ratio(self) -> np.ndarray:
        """(nx, ny, nz): det(I + H)."""
        with np.errstate(invalid="ignore"):  # unknown points
            return np.linalg.det(np.eye(3) + self.gradient)

    def along(self, axis: int) -> np.ndarray:
        """(nx, ny, nz): stretch of lines along the axis less 1, which no rotation changes."""
        return np.linalg.norm(self.gradient[..., axis] + np.eye(3)[axis], axis=-1) - 1


def cell_strain(
    points: np.ndarray, u: np.ndarray, weight: np.ndarray, valid: np.ndarray, cell_size: float
) -> CellStrain:
    """From u (n, 3) at nodes (n, 3) with their volumes (n,), of which the `valid` (n,) are used."""
    spacing = SPACING * cell_size
    low, high = points.min(axis=0), points.max(axis=0)
    counts = np.maximum(np.floor((high - low) / spacing).astype(int), 1)
    origin = (low + high - spacing * (counts - 1)) / 2
    grid = CellStrain(np.full((*counts, 3, 3), np.nan), origin, spacing)
    tree = cKDTree(points)
    for place in np.ndindex(*counts):
        x = origin + spacing * np.array(place)
        nodes = tree.query_ball_point(x, cell_size)
        if nodes:
            away = points[nodes] - x
            w = weight[nodes] * window(away, cell_size)
            grid.gradient[place] = gradient(away, u[nodes], w, valid[nodes] > 0, cell_size)
    return grid


def window(away: np.ndarray, cell_size: float) -> np.ndarray:
    """(n,): (1 - d^2)^2 at distances of d cells, 1.08 cells wide at half of its height."""
    return (1 - np.sum(away**2, axis=1) / cell_size**2).clip(0) ** 2


def gradient(
    away: np.ndarray, u: np.ndarray, weight: np.ndarray, valid: np.ndarray, cell_size: float
) -> np.ndarray:
    """Gradient (3, 3) of the affine field that fits u (n, 3) at `away` (n, 3) from a point best, with
    weights (n,), over the nodes that are `valid` (n,); nan where they cannot tell."""
    w = weight * valid
    unknown = np.full((3, 3), np.nan)
    if w.sum() < LEAST_VALID * weight.sum() or w.sum() <= 0:
        return unknown
    middle, mean = (w @ values / w.sum() for values in (away, u))
    x, v = away - middle, u - mean
    second = (w * x.T) @ x
    values = np.linalg.eigvalsh(second)
    if np.linalg.norm(middle) > OFF_CENTRE * cell_size or values[0] < FLAT * values[2]:
        return unknown
    return np.linalg.solve(second, (w * x.T) @ v).T


def described() -> dict[str, dict[str, str]]:
    """Unit and meaning of each of the `columns`."""
    return {name: {"unit": unit, "meaning": text} for name, (unit, text) in COLUMNS.items()}


def columns(strain: CellStrain, axis: int) -> dict[str, np.ndarray]:
    """A row a point of the grid: x, y, z, strain along the axis, Green-Lagrange strain, ratio of
    volumes; nan where unknown."""
    place = strain.points.reshape(-1, 3)
    green = strain.green_lagrange.reshape(-1, 3, 3)
    return (
        dict(zip("xyz", place.T, strict=True))
        | {"axial_strain": strain.along(axis).ravel()}
        | {f"e_{n}": green[:, i, j] for n, (i, j) in zip(COMPONENTS, PAIRS, strict=True)}
        | {"volume_ratio": strain.volume_ratio.ravel()}
    )
