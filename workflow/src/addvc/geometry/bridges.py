"""Bridges: struts that the threshold for the porosity breaks or loses, put back where solid is meshed.

A strut is there when the lower threshold of `geometry.sections` shows it; it is broken when no solid
of the threshold leads face to face from one of its ends to the other. Along its centre line the grey
level is raised to at least that of a rod whose radius follows from the grey level per length.
"""

import logging
from dataclasses import dataclass

import numpy as np
from scipy import ndimage, sparse
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from addvc.geometry.centre_line import Curve, along, arc_length
from addvc.geometry.lines import SPACING
from addvc.geometry.region import Region
from addvc.geometry.sections import TRIMMED, GreyStruts, cut_depth, grey_struts, sections_of, within
from addvc.geometry.skeleton import FREE_END, Branch, StrutGraph
from addvc.geometry.stuffing import NECK
from addvc.geometry.surface import CAP_SLOPE

log = logging.getLogger(__name__)

LINKED = np.sqrt(3) / 2
"""Voxels nearer than this to a line hang together by their faces: the least radius of a rod."""

OVERLAP = 1.0
"""Voxels that a bridge reaches into the solid at its ends."""


@dataclass(frozen=True, eq=False)
class Gap:
    """What a branch, by number, lacks: from one arc length of its line to another, voxels."""

    branch: int
    start: float
    stop: float


@dataclass(frozen=True, eq=False)
class Bridge:
    """Rod around points (k, 3) of radii (k,), voxels, across a gap of this `length`; the point, by
    number, where the grey level says that it is thinnest."""

    points: np.ndarray
    radii: np.ndarray
    length: float
    thinnest: int


def bridged(
    smooth: np.ndarray, reference: np.ndarray, levels: dict, region: Region, size: float
) -> tuple[np.ndarray, list[dict]]:
    """`smooth` (nx, ny, nz), blurred, raised along all bridges (a copy), and where those are: middle,
    length of the gap, mean radius, voxels; the longest first.

    Struts are found in `reference`, as it was before the blur, unless its noise forbids; `levels`:
    `find_threshold`; `size`: the edge of the mesh's lattice, that no rod is too thin for."""
    gamma, void = levels["threshold"], levels["void"]
    solid = within(region, smooth.shape) & (smooth > gamma)
    struts = grey_struts(reference - void, smooth - void, gamma - void, region)
    least = max(LINKED, NECK * size)
    bridges = [bridge(struts, gap, least) for gap in wanted_gaps(struts, solid, region)]
    raised, slope = smooth.copy(), CAP_SLOPE * (levels["solid"] - void)
    for one in bridges:
        raise_rod(raised, one, gamma, slope, levels["solid"])
    lengths = [one.length for one in bridges]
    log.info("%d bridges, %.1f voxels in all", len(bridges), sum(lengths))
    return raised, listed(bridges)


def wanted_gaps(struts: GreyStruts, solid: np.ndarray, region: Region) -> list[Gap]:
    """Gaps of the struts that lead from solid to solid once all are bridged."""
    graph = struts.graph
    held = np.array([leads_on(b, graph, region) for b in graph.branches], dtype=bool)
    held = lasting(graph, anchored(graph, solid), held)
    gaps = [gap_of(struts, number, solid) for number in np.flatnonzero(held)]
    return [gap for gap in gaps if gap is not None]


def leads_on(branch: Branch, graph: StrutGraph, region: Region) -> bool:
    """Whether a branch ends at junctions, or where the region cuts it."""
    tips = np.array([branch.points[k] for k, end in zip((0, -1), branch.ends, strict=True)
                     if end == FREE_END]).reshape(-1, 3)  # fmt: skip
    return bool((cut_depth(region, tips) <= 2 * np.median(graph.radii)).all())


def anchored(graph: StrutGraph, solid: np.ndarray) -> np.ndarray:
    """Which junctions (j,) are in, or within a voxel of, the largest face-connected solid."""
    label, _ = ndimage.label(solid)
    size = np.bincount(label.ravel(), minlength=2)
    size[0] = 0
    if size.max() == 0 or len(graph.junctions) == 0:
        return np.zeros(len(graph.junctions), dtype=bool)
    away, _ = cKDTree(np.argwhere(label == size.argmax())).query(graph.junctions)
    return away <= graph.radii + 1


def lasting(graph: StrutGraph, fixed: np.ndarray, held: np.ndarray) -> np.ndarray:
    """Which of the branches (b,) `held` are left when those that end at a junction where nothing else
    does are dropped, one after the other; `fixed` (j,): junctions that hold by themselves."""
    ends = np.array([branch.ends for branch in graph.branches], dtype=int).reshape(-1, 2)
    while True:
        met = ends[held]
        degree = np.bincount(met[met != FREE_END], minlength=len(fixed))
        firm = np.append(fixed | (degree > 1), True)  # the last stands for FREE_END
        left = held & firm[ends].all(axis=1)
        if left.sum() == held.sum():
            return left
        held = left


def gap_of(struts: GreyStruts, number: int, solid: np.ndarray) -> Gap | None:
    """Where a branch lacks solid between its ends, None where a piece of it spans both."""
    branch, line = struts.graph.branches[number], struts.lines[number]
    length = arc_length(line)[-1]
    own = struts.solid.voxels[struts.owned[number]].astype(int)
    own = own[solid[tuple(own.T)]]
    reach = [
        TRIMMED * length if end == FREE_END else min(struts.graph.radii[end] + 1, TRIMMED * length)
        for end in branch.ends
    ]
    low, high = spans(own, along(line, own) if len(own) else np.zeros(0))
    first, last = low <= reach[0], high >= length - reach[1]
    if (first & last).any() or (FREE_END in branch.ends and not (first.any() and last.any())):
        return None
    start, stop = high[first].max(initial=0.0), low[last].min(initial=length)
    return Gap(number, *sorted((float(start), float(stop))))


def spans(voxels: np.ndarray, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The least and the greatest arc length (p,) of each of the pieces of voxels (q, 3) at s (q,) that
    hang together by faces."""
    if len(voxels) == 0:
        return np.zeros(0), np.zeros(0)
    pairs = cKDTree(voxels).query_pairs(1.1, output_type="ndarray")
    links = sparse.coo_matrix((np.ones(len(pairs)), pairs.T), shape=(len(voxels),) * 2)
    count, piece = connected_components(links, directed=False)
    return tuple(np.asarray(f(s, piece, range(count))) for f in (ndimage.minimum, ndimage.maximum))


def bridge(struts: GreyStruts, gap: Gap, least: float) -> Bridge:
    """The rod across a gap, of at least this radius, with the grey level's section at each point."""
    curve, own = struts.curves[gap.branch], struts.owned[gap.branch]
    length = arc_length(struts.lines[gap.branch])[-1]
    start, stop = max(gap.start - OVERLAP, 0), min(gap.stop + OVERLAP, length)
    s = np.linspace(start, stop, max(2, round((stop - start) / SPACING) + 1))
    inner = np.clip(s, curve.middle - curve.half, curve.middle + curve.half)
    area = sections_of(curve, inner, struts.solid.voxels[own], struts.solid.share[own])
    points = path(struts, gap.branch, curve, s, length)
    radii = np.maximum(np.sqrt(area / np.pi), least)
    between = (inner == s) & (s >= gap.start) & (s <= gap.stop)  # where the section is known
    thinnest = np.where(between, area, np.inf).argmin() if between.any() else len(s) // 2
    return Bridge(points, radii, gap.stop - gap.start, int(thinnest))


def path(struts: GreyStruts, number: int, curve: Curve, s: np.ndarray, length: float) -> np.ndarray:
    """Points (k, 3) at arc lengths (k,): on the curve, and straight from its ends to the junctions."""
    inner = np.linspace(curve.middle - curve.half, curve.middle + curve.half, 8 * len(s))
    at, points = [inner], [curve(inner)]
    first, last = struts.graph.branches[number].ends
    if first != FREE_END:
        at, points = [[0.0], *at], [struts.graph.junctions[[first]], *points]
    if last != FREE_END:
        at, points = [*at, [length]], [*points, struts.graph.junctions[[last]]]
    knots, places = np.concatenate(at), np.vstack(points)
    return np.stack([np.interp(s, knots, x) for x in places.T], axis=1)


def raise_rod(grey: np.ndarray, rod: Bridge, gamma: float, slope: float, most: float) -> None:
    """Raise `grey` (nx, ny, nz) in place to at least gamma + slope x depth below the surface of a rod,
    at most to `most`."""
    reach = rod.radii.max() + 1 / CAP_SLOPE  # where it is below the void
    low = np.maximum(np.floor(rod.points.min(axis=0) - reach), 0).astype(int)
    high = np.minimum(np.ceil(rod.points.max(axis=0) + reach) + 1, grey.shape).astype(int)
    box = tuple(slice(a, b) for a, b in zip(low, high, strict=True))
    voxels = np.moveaxis(np.indices(high - low), 0, -1) + low
    away, nearest = cKDTree(rod.points).query(voxels)
    inside = np.minimum(gamma + slope * (rod.radii[nearest] - away), most)
    grey[box] = np.maximum(grey[box], inside)


def direction(rod: Bridge) -> np.ndarray:
    """Unit vector (3,) along a rod where it is thinnest, over its radius there."""
    away = np.linalg.norm(rod.points - rod.points[rod.thinnest], axis=1)
    near = np.flatnonzero(away <= max(rod.radii[rod.thinnest], np.sort(away)[1]))
    vector = rod.points[near[-1]] - rod.points[near[0]]
    return vector / max(np.linalg.norm(vector), 1e-12)


def listed(bridges: list[Bridge]) -> list[dict]:
    """The bridges as data, the longest first; `thinnest`: where they are, `direction`: the unit vector
    along them there."""
    along = [direction(one) for one in bridges]
    rows = [
        {
            "position": one.points[len(one.points) // 2].tolist(),
            "thinnest": one.points[one.thinnest].tolist(),
            "direction": there.tolist(),
            "length": one.length,
            "radius": float(one.radii.mean()),
        }
        for one, there in zip(bridges, along, strict=True)
    ]
    return sorted(rows, key=lambda row: -row["length"])
