"""The region of micro DVC (Fig. 8), its caps, and the nodes on them (Fig. 9)."""

from dataclasses import dataclass

import numpy as np

from addvc.errors import GeometryError
from addvc.fem.mesh import Mesh, boundary_faces
from addvc.images.specimen import Specimen


@dataclass(frozen=True)
class Region:
    """A slab [low, high] along `axis`, inside a circle (centre, radius) or a rectangle (bounds).

    All in voxels; `cut_sides` says that the sides cut through material (a box, or a core)."""

    axis: int
    low: float
    high: float
    centre: tuple[float, float] | None = None
    radius: float | None = None
    bounds: tuple[tuple[float, float], tuple[float, float]] | None = None
    cut_sides: bool = False


def micro_region(specimen: Specimen, setting, margin: float = 3.0, sides: str = "auto") -> Region:
    """Region of `micro.region`: "all" (up to `margin` voxels from platens or image ends), or a dict
    {low, high, radius}, any of them left out for the whole.

    `sides` of the specimen: "free", with `margin` voxels of air, or "cut" through material, kept clear
    of by as much; "auto": free of a cylinder, cut of a box.

    Raises GeometryError when it is empty."""
    wanted = {} if setting == "all" else dict(setting)
    low = max(wanted.get("low", -np.inf), specimen.low + margin)
    high = min(wanted.get("high", np.inf), specimen.high - margin)
    if high - low < 4:
        given = ", ".join(f"{key} = {value:g}" for key, value in wanted.items())
        raise GeometryError(
            f"micro.region ({given or 'all'}) leaves {max(high - low, 0):.1f} voxels along the loading "
            f"axis (at least 4) of {specimen.low + margin:.1f} to {specimen.high - margin:.1f}, where "
            "the specimen is (voxels of the binned image); give a slab within that"
        )
    cut = specimen.kind == "box" if sides == "auto" else sides == "cut"
    beyond = -margin if cut else margin
    if specimen.kind == "box":
        width = wanted.get("radius", np.inf)
        bounds = []
        for a, b in specimen.bounds:
            half = min((b - a) / 2 + beyond, width)
            bounds.append(((a + b) / 2 - half, (a + b) / 2 + half))
            cut |= half < (b - a) / 2
        return Region(specimen.axis, low, high, bounds=tuple(bounds), cut_sides=cut)
    radius = min(wanted.get("radius", np.inf), specimen.radius + beyond)
    cut |= radius < specimen.radius
    return Region(specimen.axis, low, high, tuple(specimen.centre), radius, cut_sides=cut)


def worst_slab(
    specimen: Specimen, setting: dict, square: list, count: list, margin: float = 3.0, **_
) -> dict:
    """`micro.region` {height, radius} as {low, high, radius}: of the slabs of this height (voxels) that
    where meso DVC leaves the largest mean of r^2.

    square, count: sum of r^2 and number of points in each plane of voxels across the loading axis."""
    low, high = specimen.low + margin, specimen.high - margin
    height = min(float(setting["height"]), high - low)
    sums = [np.concatenate([[0.0], np.cumsum(values)]) for values in (square, count)]
    edges = np.arange(len(sums[0])) - 0.5  # of the planes
    starts = np.arange(low, high - height + 1e-9, 0.5)
    inside = [np.interp(starts + height, edges, s) - np.interp(starts, edges, s) for s in sums]
    first = float(starts[np.argmax(inside[0] / np.maximum(inside[1], 1.0))])
    rest = {key: value for key, value in setting.items() if key != "height"}
    return rest | {"low": first, "high": first + height}


def caps_depth(region: Region, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Depth (n,) of points (n, 3) below the two end caps, and below the sides; negative outside."""
    along = points[..., region.axis]
    ends = np.minimum(along - region.low, region.high - along)
    across = points[..., [d for d in range(3) if d != region.axis]]
    if region.radius is not None:
        sides = region.radius - np.linalg.norm(across - region.centre, axis=-1)
    else:
        low, high = np.array(region.bounds).T
        sides = np.minimum(across - low, high - across).min(axis=-1)
    return ends, sides


FREE, ENDS, SIDES = 0, 1, 2


def node_classes(mesh: Mesh, region: Region, sides: str, depth: float = 0.75) -> dict:
    """Fig. 9: for each node (n,) uint8 `surface` FREE, ENDS or SIDES, and `penalised` (D_L).

    `sides` is "penalised" (Fig. 9c: the outer flank may touch the tube, or cuts material) or
    "free" (Fig. 9a). A node is on a cap when it is a surface node within `depth` voxels of it; the
    flank of an uncut cylinder is its outermost `depth` + 3 voxels (its margin)."""
    surface = np.zeros(len(mesh.points), dtype=bool)
    surface[np.unique(boundary_faces(mesh))] = True
    below_ends, below_sides = caps_depth(region, mesh.points)
    ends = surface & (below_ends < depth)
    flank = surface & ~ends & (below_sides < (depth if region.cut_sides else depth + 3))
    classes = np.select([ends, flank], [ENDS, SIDES], FREE).astype(np.uint8)
    kept = np.where((classes == SIDES) & (sides == "free"), FREE, classes).astype(np.uint8)
    return {"surface": classes, "penalised": kept}
