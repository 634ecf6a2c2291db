"""Struts as beams: subdivision, bow, radius along the strut, three-lobed section."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .foam import HIGH, JUNCTION, LOW, Skeleton
from .options import Specimen, TwinOptions, specimen

ELEMENT = 2.6
"""Target length of a beam element, voxels."""


@dataclass(frozen=True)
class Network:
    """Beams of the reference; lengths in voxels of the binned image.

    nodes (n, 3); elements (m, 2) int32, in order along each strut; strut (m,) int32, the strut an
    element belongs to; radii (m, 2) at both ends of an element; director (m, 3), unit, normal to
    the element: a lobe of the section points along it; kind (n,) int8: JUNCTION, LOW, HIGH, FREE,
    or -1 within a strut; body: the cylinder and its platens.
    """

    nodes: np.ndarray
    elements: np.ndarray
    strut: np.ndarray
    radii: np.ndarray
    director: np.ndarray
    kind: np.ndarray
    body: Specimen


def area_profile(xi: np.ndarray) -> np.ndarray:
    """Area over that at mid-span, xi in [-1/2, 1/2] along the strut: 1 to 2.25. The form is that of
    [Gong2005], who measured 1 + xi^2 + 36 xi^4, milder since the twin's struts are short."""
    return 1 + 2 * xi**2 + 12 * xi**4


def roughness(s: np.ndarray, size: float, rng: np.random.Generator) -> np.ndarray:
    """Smooth random factor of the radius at arc lengths s (n,), deviation `size`: three waves of 5
    to 12 voxels."""
    length = rng.uniform(5, 12, 3)
    phase = rng.uniform(0, 2 * np.pi, 3)
    waves = np.sin(2 * np.pi * s[:, None] / length + phase)
    return 1 + size * np.sqrt(2 / 3) * waves.sum(axis=1)


def weak_band(points: np.ndarray, body: Specimen, options: TwinOptions) -> np.ndarray:
    """Factor of the radius at points (n, 3): a tilted band through the middle is thinner."""
    tilt = np.deg2rad(options.tilt)
    normal = np.array([np.sin(tilt), np.cos(tilt), 0.0])
    sigma = min(14.0, 0.12 * body.height)
    distance = (points - body.centre) @ normal
    return 1 - options.weakening * np.exp(-0.5 * (distance / sigma) ** 2)


def across(axis: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Random unit vector normal to the unit vector axis (3,)."""
    v = rng.standard_normal(3)
    v -= (v @ axis) * axis
    return v / np.linalg.norm(v)


def strut_beams(
    a: np.ndarray, b: np.ndarray, whole: bool, options: TwinOptions, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """One strut from a to b (3,) -> points (k + 1, 3), relative radii (k + 1,), lobe (3,).

    A strut cut at b (not whole) has its thinnest section there.
    """
    length = np.linalg.norm(b - a)
    axis = (b - a) / length
    share = np.linspace(0, 1, max(2, round(length / ELEMENT)) + 1)
    bow = options.bow * abs(rng.standard_normal()) * length
    points = a + share[:, None] * (b - a)
    points += bow * np.sin(np.pi * share)[:, None] * across(axis, rng)
    points[-1] = b
    xi = (share - 0.5) if whole else 0.5 * (share - 1)
    scatter = 1 + options.scatter * np.clip(rng.standard_normal(), -2.5, 2.5)
    radii = scatter * np.sqrt(area_profile(xi)) * roughness(share * length, options.roughness, rng)
    return points, radii, across(axis, rng)


def element_directors(points: np.ndarray, lobe: np.ndarray) -> np.ndarray:
    """The strut's lobe (3,) made normal to each element of points (k + 1, 3) -> (k, 3)."""
    axis = np.diff(points, axis=0)
    axis /= np.linalg.norm(axis, axis=1)[:, None]
    d = lobe - (axis @ lobe)[:, None] * axis
    return d / np.linalg.norm(d, axis=1)[:, None]


def chains(skeleton: Skeleton, counts: list[int]) -> list[np.ndarray]:
    """Node numbers along each strut; inner nodes, counts of them, follow the skeleton's."""
    first = len(skeleton.nodes) + np.cumsum([0, *counts])
    return [
        np.r_[i, start + np.arange(count), j]
        for (i, j), start, count in zip(skeleton.edges, first, counts, strict=False)
    ]


def subdivide(skeleton: Skeleton, options: TwinOptions) -> Network:
    """Beams of all struts, with a mid-span radius of 1 on average."""
    rng = np.random.default_rng([options.seed, 2])
    cut_first = skeleton.kind[skeleton.edges[:, 0]] != JUNCTION
    edges = np.where(cut_first[:, None], skeleton.edges[:, ::-1], skeleton.edges)
    whole = skeleton.kind[edges[:, 1]] == JUNCTION
    ends = skeleton.nodes[edges]
    points, radii, lobes = zip(
        *(strut_beams(a, b, w, options, rng) for (a, b), w in zip(ends, whole, strict=True)),
        strict=True,
    )
    inner = [len(p) - 2 for p in points]
    number = chains(Skeleton(skeleton.nodes, skeleton.kind, edges), inner)
    body = specimen(options)
    if options.band:
        radii = [r * weak_band(p, body, options) for r, p in zip(radii, points, strict=True)]
    return Network(
        np.concatenate([skeleton.nodes, *(p[1:-1] for p in points)]),
        np.concatenate([np.c_[c[:-1], c[1:]] for c in number]).astype(np.int32),
        np.repeat(np.arange(len(edges), dtype=np.int32), np.array(inner) + 1),
        np.concatenate([np.c_[r[:-1], r[1:]] for r in radii]),
        np.concatenate([element_directors(p, d) for p, d in zip(points, lobes, strict=True)]),
        np.r_[skeleton.kind, np.full(sum(inner), -1, np.int8)],
        body,
    )


def thicken(network: Network, factor: float) -> Network:
    """The same network with all radii times factor."""
    return replace(network, radii=factor * network.radii)


def junctions(network: Network) -> np.ndarray:
    """(n, 3) reference positions of the points where struts meet, voxels."""
    return network.nodes[network.kind == JUNCTION]


def platen_nodes(network: Network) -> tuple[np.ndarray, np.ndarray]:
    """Indices of the nodes clamped to the lower and to the upper platen."""
    return np.flatnonzero(network.kind == LOW), np.flatnonzero(network.kind == HIGH)
