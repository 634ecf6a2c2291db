"""The whole foam as a frame of beams, thin struts included, from the grey level of the reference.

The mesh of micro DVC holds what the threshold for the porosity keeps; it loses thin struts, which
carry load all the same. A lower threshold keeps the network whole (`geometry.sections`). A junction is
the point nearest to the lines of its struts, continued straight on.
"""

from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
from scipy import ndimage
from scipy.spatial import cKDTree

from addvc.fem.frame import Frame
from addvc.geometry.centre_line import Curve, arc_length
from addvc.geometry.region import Region
from addvc.geometry.sections import CUT, Solid, cut_depth, grey_struts, mean_radius, sections_of
from addvc.geometry.skeleton import FREE_END, Branch, StrutGraph
from addvc.images.files import atomic_path

PIECE, PIECE_RADII = 2.6, 1.2
"""Target length of a piece: voxels, and radii of its strut where these are more."""

SHORTEST = 0.8
"""A piece, at least, voxels: its stiffness goes with one over its length."""

ASTRAY, ASTRAY_RADII = 1.5, 0.6
"""How far from the skeleton's a junction may be put: voxels, and radii of its ball where these are
more."""

DOUBT = 0.1
"""Weight of the skeleton's junction against the line of one strut."""


@dataclass(frozen=True, eq=False)
class StrutFrame:
    """The frame, and which of its nodes (n,) may be loaded from outside; `span`: the median length of
    its struts, voxels."""

    frame: Frame
    loaded: np.ndarray
    span: float


def strut_frame(
    excess: np.ndarray, blurred: np.ndarray, limit: float, region: Region
) -> StrutFrame:
    """The frame of the solid within the region, of grey levels (nx, ny, nz) above that of the void:
    excess as scanned, blurred as the threshold for the porosity is of, which is `limit` above it."""
    found = grey_struts(excess, blurred, limit, region)
    if not found.graph.branches:
        return StrutFrame(Frame(np.zeros((0, 3)), np.zeros((0, 2), int), np.zeros(0)),
                          np.zeros(0, bool), 0.0)  # fmt: skip
    frame, span = assembled(found.graph, found.curves, found.owned, found.solid)
    return StrutFrame(frame, loaded(frame.points, found.mask, region), span)


def crossings(graph: StrutGraph, curves: list[Curve]) -> np.ndarray:
    """Junctions (j, 3) nearest to the lines of their struts, continued straight on."""
    matrix = np.tile(DOUBT * np.eye(3), (len(graph.junctions), 1, 1))
    right = DOUBT * graph.junctions
    for branch, curve in zip(graph.branches, curves, strict=True):
        for end, side in zip(branch.ends, (-1, 1), strict=True):
            if end == FREE_END:
                continue
            s = np.array([curve.middle + side * curve.half])
            tangent = curve.tangent(s)[0]
            across = np.eye(3) - np.outer(tangent, tangent) / (tangent @ tangent)
            matrix[end] += across
            right[end] += across @ curve(s)[0]
    step = np.linalg.solve(matrix, right[..., None])[..., 0] - graph.junctions
    far, most = np.linalg.norm(step, axis=1), astray(graph)
    return graph.junctions + step * np.minimum(1, most / np.maximum(far, 1e-12))[:, None]


def astray(graph: StrutGraph) -> np.ndarray:
    """How far from the skeleton's each junction (j,) may be put, so that none comes nearer than
    SHORTEST to another."""
    most = np.maximum(ASTRAY, ASTRAY_RADII * graph.radii)
    if len(most) < 2:
        return most
    apart = cKDTree(graph.junctions).query(graph.junctions, k=2)[0][:, 1]
    return np.clip((apart - SHORTEST) / 2, 0, most)


def assembled(
    graph: StrutGraph, curves: list[Curve], owned: list, solid: Solid
) -> tuple[Frame, float]:
    """Pieces along all curves, and from their ends straight to the junctions; the median length of the
    struts."""
    junctions = crossings(graph, curves)
    points, pieces, area, count = [junctions], [], [], len(junctions)
    for branch, curve, own in zip(graph.branches, curves, owned, strict=True):
        radius = mean_radius(solid.share[own].sum(), 2 * curve.half)
        s = stations(branch, curve, junctions, max(PIECE, PIECE_RADII * radius))
        chain = linked(branch, count + np.arange(len(s)))
        points.append(curve(s))
        pieces.append(chain)
        at = middles(branch, s) if len(s) else np.full(len(chain), curve.middle)
        wider = widening(branch, along_strut(branch, curve(s), junctions))
        area.append(wider * sections_of(curve, at, solid.voxels[own], solid.share[own]))
        count += len(s)
    frame = Frame(*(np.concatenate(part) for part in (points, pieces, area)))
    strut = np.repeat(np.arange(len(pieces)), [len(part) for part in pieces])
    return frame, float(np.median(np.bincount(strut, frame.length)))


def linked(branch: Branch, inner: np.ndarray) -> np.ndarray:
    """Pieces (m, 2) along the nodes (g,) of a strut, from its junction to its junction; none of a strut
    without nodes that ends where it starts."""
    first, second = (np.array([end] if end != FREE_END else [], int) for end in branch.ends)
    chain = np.concatenate([first, inner, second])
    pieces = np.stack([chain[:-1], chain[1:]], axis=1)
    return pieces[pieces[:, 0] != pieces[:, 1]]


def middles(branch: Branch, s: np.ndarray) -> np.ndarray:
    """Arc lengths (m,) of the pieces between nodes at s (g,); of those to junctions, their nodes."""
    first, second = (int(end != FREE_END) for end in branch.ends)
    return np.concatenate([s[:first], (s[1:] + s[:-1]) / 2, s[len(s) - second :]])


def along_strut(branch: Branch, inner: np.ndarray, junctions: np.ndarray) -> np.ndarray:
    """Arc lengths (m + 1,) of the ends of the pieces (m,) of a strut with nodes (g, 3)."""
    first, second = (junctions[[end] if end != FREE_END else []] for end in branch.ends)
    return arc_length(np.concatenate([first, inner, second]))


def widening(branch: Branch, ends: np.ndarray) -> np.ndarray:
    """Factor (m,) on the measured area of each piece, from the arc lengths (m + 1,) of their ends.

    A piece that leads to a junction is measured at its inner end, since beyond that the solid is that
    of several struts; it widens as `area_ratio` says. On the default twin, whose struts have another
    profile, such pieces have .82 of the true area without it and 1.14 with it."""
    factor = np.ones(len(ends) - 1)
    if len(factor) < 2:
        return factor
    x, (first, last) = ends / ends[-1] - 0.5, branch.ends
    if first != FREE_END:
        factor[0] = area_ratio(x[1], x[0])
    if last != FREE_END:
        factor[-1] = area_ratio(x[-2], x[-1])
    return factor


def area_ratio(inner: float, junction: float) -> float:
    """Area of the uniform piece that bends as much as a strut of polyurethane foam does between two
    places, over that at the inner one; x is -1/2 to 1/2 along the strut, the area of its sections goes
    as 1 + x^2 + 36 x^4 [Gong2005], their inertia with its square."""
    x = np.linspace(inner, junction, 21)
    area = 1 + x**2 + 36 * x**4
    return float(np.mean(area**-2.0) ** -0.5 / area[0])


def stations(branch: Branch, curve: Curve, junctions: np.ndarray, piece: float) -> np.ndarray:
    """Arc lengths (g,) of a curve where its nodes are, about a piece apart; none that is nearer than
    SHORTEST to another or to a junction, so that a short curve may have no node."""
    s = curve.middle + curve.half * np.linspace(-1, 1, max(2, round(2 * curve.half / piece)) + 1)
    taken, kept = [junctions[end] for end in branch.ends if end != FREE_END], []
    for k, point in enumerate(curve(s)):
        if all(np.linalg.norm(point - other) >= SHORTEST for other in taken):
            taken.append(point)
            kept.append(k)
    return s[kept]


def loaded(points: np.ndarray, mask: np.ndarray, region: Region) -> np.ndarray:
    """Which nodes (n,) may be loaded from outside: those at a cut, and the nearest to each patch of the
    solid (nx, ny, nz) there, where a strut goes on that may be too short here to have nodes."""
    out = cut_depth(region, points) <= CUT
    grid = np.moveaxis(np.indices(mask.shape, dtype=np.float32), 0, -1)
    label, count = ndimage.label(mask & (cut_depth(region, grid) <= CUT), np.ones((3, 3, 3)))
    if count:
        patches = np.array(ndimage.center_of_mass(mask, label, range(1, count + 1)))
        out[cKDTree(points).query(patches)[1]] = True
    return out


def save_frame(path: str | Path, held: StrutFrame) -> None:
    """HDF5."""
    with atomic_path(path) as temporary, h5py.File(temporary, "w") as file:
        for name in ("points", "pieces", "area"):
            file[name] = getattr(held.frame, name)
        file["loaded"] = held.loaded
        file.attrs.update({"span": held.span, "unit": "voxel of the binned image"})


def load_frame(path: str | Path) -> StrutFrame:
    """What `save_frame` wrote."""
    with h5py.File(path) as file:
        frame = Frame(*(file[name][:] for name in ("points", "pieces", "area")))
        return StrutFrame(frame, file["loaded"][:], float(file.attrs["span"]))
