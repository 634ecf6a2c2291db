"""Struts by their grey level: those that a threshold loses too, their centre lines, their sections.

A threshold below that for the porosity keeps the network whole (`solid_mask`): its skeleton gives the
struts, the centroids of the grey level their lines, the grey level per length their sections; both
bear noise and are of the image as scanned.
"""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from addvc.geometry.centre_line import Curve, along, arc_length, centre_line
from addvc.geometry.lines import nearest_line, resampled
from addvc.geometry.region import Region, caps_depth
from addvc.geometry.skeleton import FREE_END, Branch, StrutGraph, strut_graph
from addvc.geometry.solid_mask import solid_mask

TRIMMED = 0.3
"""Most of a strut that a junction takes at each end, where the balls of both would leave nothing."""

LEAST_AREA = 0.3
"""Of a section, voxel^2."""

HALO = 2
"""Voxels around the solid that hold grey level of it."""

CUT = 1.0
"""Depth below the surface of the region, voxels, where struts are cut."""


@dataclass(frozen=True, eq=False)
class Solid:
    """Voxels (q, 3) in and near the solid with their share (q,) of solid, and the grey level
    (nx, ny, nz) above that of the void."""

    voxels: np.ndarray
    share: np.ndarray
    excess: np.ndarray


@dataclass(frozen=True, eq=False)
class GreyStruts:
    """What lies above the lower threshold, `mask` (nx, ny, nz); its graph; for each branch of that its
    line (k, 3), its curve and which voxels of `solid` are its own (q,)."""

    mask: np.ndarray
    graph: StrutGraph
    lines: list[np.ndarray]
    curves: list[Curve]
    owned: list[np.ndarray]
    solid: Solid


def grey_struts(
    excess: np.ndarray, blurred: np.ndarray, limit: float, region: Region
) -> GreyStruts:
    """The struts of the solid within the region, of grey levels (nx, ny, nz) above that of the void:
    excess as scanned, blurred as the threshold for the porosity is of, which is `limit` above it."""
    inside = within(region, excess.shape)
    mask = solid_mask(excess, blurred, limit, inside)
    graph = strut_graph(mask)
    near = ndimage.binary_dilation(mask, iterations=HALO) & inside
    contrast = excess[near].sum() / max((inside & (blurred > limit)).sum(), 1)
    solid = Solid(np.argwhere(near).astype(float), excess[near] / contrast, excess * inside)
    if not graph.branches:
        return GreyStruts(mask, graph, [], [], [], solid)
    lines = [resampled(branch.points) for branch in graph.branches]
    owned = nearest_line(lines, solid.voxels)
    curves = [
        strut_curve(branch, line, solid.share[own].sum(), graph.radii, solid.excess)
        for branch, line, own in zip(graph.branches, lines, owned, strict=True)
    ]
    return GreyStruts(mask, graph, lines, curves, owned, solid)


def within(region: Region, shape: tuple[int, ...]) -> np.ndarray:
    """(nx, ny, nz) bool: voxels of an image that are in the region."""
    grid = np.moveaxis(np.indices(shape, dtype=np.float32), 0, -1)
    ends, sides = caps_depth(region, grid)
    return (ends > 0) & (sides > 0)


def mean_radius(volume: float, length: float) -> float:
    """Of a round strut, voxels."""
    return float(np.sqrt(max(volume, LEAST_AREA) / (np.pi * length)))


def strut_curve(
    branch: Branch, line: np.ndarray, volume: float, radii: np.ndarray, excess: np.ndarray
) -> Curve:
    """The centre line of a strut of this volume between the balls of its junctions, of radii (j,)."""
    length = arc_length(line)[-1]
    radius = mean_radius(volume, length)
    trims = np.array([0.0 if end == FREE_END else radii[end] for end in branch.ends])
    if length - trims.sum() < 2 * radius:
        trims = np.minimum(trims, TRIMMED * length)
    return centre_line(line, (trims[0], length - trims[1]), radius, excess)


def sections_of(
    curve: Curve, stations: np.ndarray, voxels: np.ndarray, share: np.ndarray
) -> np.ndarray:
    """Areas (g,) at arc lengths (g,) of a curve from the shares (q,) of solid of its voxels (q, 3)."""
    line = curve(np.linspace(curve.middle - curve.half, curve.middle + curve.half, len(voxels) + 2))
    s = curve.projected(voxels, curve.middle - curve.half + along(line, voxels))
    radius = mean_radius(share.sum(), 2 * curve.half)
    return np.maximum(section_areas(stations, s, share, max(radius / 2, 0.5)), LEAST_AREA)


def section_areas(
    stations: np.ndarray, s: np.ndarray, volume: np.ndarray, width: float
) -> np.ndarray:
    """Area (g,) of the sections at arc lengths (g,): volumes (q,) at arc lengths (q,) per length, by
    a Gaussian window."""
    window = np.exp(-0.5 * ((stations[:, None] - s) / width) ** 2)
    return window @ volume / (np.sqrt(2 * np.pi) * width)


def cut_depth(region: Region, points: np.ndarray) -> np.ndarray:
    """Depth (...) of points (..., 3) below the surfaces of the region that cut through the solid."""
    caps, sides = caps_depth(region, points)
    return np.minimum(caps, sides) if region.cut_sides else caps
