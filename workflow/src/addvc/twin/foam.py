"""The skeleton of the foam: edges of a power (Laguerre) diagram, cut to the specimen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, cKDTree

from addvc.errors import ConfigError

from .options import Specimen, TwinOptions, specimen
from .packing import MEAN_RADIUS, pack

JUNCTION, LOW, HIGH, FREE = 0, 1, 2, 3
"""Kinds of skeleton nodes: where struts meet, ends on the platens, ends cut at the side."""

SHORT = 0.3
"""Edges shorter than this share of the mean length are collapsed."""

SNAP = 2.0
"""Junctions closer than this to a platen are put on it; shorter stubs are dropped (voxels)."""

CLEARANCE = 4.0
"""A cut strut nearer than this to a strut it does not meet is dropped (voxels)."""


@dataclass(frozen=True)
class Skeleton:
    """Straight struts: nodes (n, 3) voxels, kind (n,) int8, edges (s, 2) int32."""

    nodes: np.ndarray
    kind: np.ndarray
    edges: np.ndarray


def power_diagram(seeds: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (v, 3) and edges (e, 2) of the power diagram of seeds (n, 3), weights (n,).

    Lower hull of the lift (x, |x|^2 - w) [Aurenhammer1987]: a facet with normal n (n_4 < 0) is a
    simplex whose power centre is -n_123 / (2 n_4); two adjacent simplices share an edge.
    """
    lift = np.c_[seeds, np.sum(seeds**2, axis=1) - weights]
    hull = ConvexHull(lift)
    normal = hull.equations[:, :4]
    lower = normal[:, 3] < -1e-9
    vertices = -normal[lower, :3] / (2 * normal[lower, 3:])
    number = np.full(len(normal), -1)
    number[lower] = np.arange(lower.sum())
    edges = np.c_[np.repeat(number, 4), number[hull.neighbors.ravel()]]
    return vertices, edges[(edges[:, 0] >= 0) & (edges[:, 0] < edges[:, 1])]


def compact(nodes: np.ndarray, edges: np.ndarray, *more: np.ndarray) -> tuple[np.ndarray, ...]:
    """Drop nodes without edge, loops and doubles -> nodes, edges, further arrays per node."""
    edges = np.unique(np.sort(edges[edges[:, 0] != edges[:, 1]], axis=1), axis=0)
    used, renumbered = np.unique(edges, return_inverse=True)
    return nodes[used], renumbered.reshape(-1, 2).astype(np.int32), *(a[used] for a in more)


def collapse(nodes: np.ndarray, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Merge the ends of edges shorter than SHORT times the mean into their centroid.

    nodes (n, 3) in voxels, edges (e, 2) -> those left, renumbered.
    """
    length = edge_length(nodes, edges)
    short = edges[length < SHORT * length.mean()]
    n = len(nodes)
    graph = coo_array((np.ones(len(short)), short.T), shape=(n, n))
    count, group = connected_components(graph, directed=False)
    size = np.bincount(group, minlength=count)
    merged = np.stack([np.bincount(group, x, count) / size for x in nodes.T], axis=1)
    return compact(merged, group[edges])


def smooth(nodes: np.ndarray, edges: np.ndarray, passes: int = 3) -> np.ndarray:
    """Laplacian smoothing: each node goes half-way to the mean of its neighbours, `passes` times.

    nodes (n, 3), edges (e, 2) -> nodes (n, 3).
    """
    both = np.r_[edges, edges[:, ::-1]]
    degree = np.bincount(both[:, 0], minlength=len(nodes))[:, None]
    for _ in range(passes):
        total = np.stack([np.bincount(both[:, 0], x[both[:, 1]], len(nodes)) for x in nodes.T], 1)
        nodes = 0.5 * (nodes + total / degree)
    return nodes


def edge_length(nodes: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """(e,) lengths."""
    return np.linalg.norm(nodes[edges[:, 1]] - nodes[edges[:, 0]], axis=1)


def open_network(options: TwinOptions, body: Specimen) -> tuple[np.ndarray, np.ndarray]:
    """Nodes (n, 3) and edges (e, 2) of a foam that covers the specimen and a margin."""
    rng = np.random.default_rng([options.seed, 1])
    stretch = np.array([1, options.elongation, 1]) / options.elongation ** (1 / 3)
    margin = 1.5 * options.cell_size
    extent = np.array([2 * body.radius, body.height, 2 * body.radius])
    box = (extent + 2 * margin) / stretch
    seeds, radii = pack(box, MEAN_RADIUS * options.cell_size, rng)
    nodes, edges = power_diagram(seeds, radii**2)
    inside = np.all((nodes > 0) & (nodes < box), axis=1)
    nodes, edges = compact(nodes, edges[inside[edges].all(axis=1)])
    nodes, edges = collapse(nodes, edges)
    return (smooth(nodes, edges) - box / 2) * stretch + body.centre, edges


def snap(nodes: np.ndarray, body: Specimen) -> tuple[np.ndarray, np.ndarray]:
    """Put junctions that nearly touch a platen on it -> nodes, kind (n,)."""
    nodes, kind = nodes.copy(), np.full(len(nodes), JUNCTION, np.int8)
    for k, y in ((LOW, body.low), (HIGH, body.high)):
        touching = np.abs(nodes[:, 1] - y) < SNAP
        nodes[touching, 1], kind[touching] = y, k
    return nodes, kind


def exit_share(a: np.ndarray, b: np.ndarray, body: Specimen) -> tuple[np.ndarray, np.ndarray]:
    """Where segments from a (n, 3) inside to b (n, 3) outside leave -> share (n,), kind (n,)."""
    d, p = b - a, a - body.centre
    with np.errstate(divide="ignore", invalid="ignore"):
        low = np.where(d[:, 1] < 0, (body.low - a[:, 1]) / d[:, 1], np.inf)
        high = np.where(d[:, 1] > 0, (body.high - a[:, 1]) / d[:, 1], np.inf)
        qa = d[:, 0] ** 2 + d[:, 2] ** 2
        qb = p[:, 0] * d[:, 0] + p[:, 2] * d[:, 2]
        qc = p[:, 0] ** 2 + p[:, 2] ** 2 - body.radius**2
        side = (-qb + np.sqrt(qb**2 - qa * qc)) / qa
    shares = np.stack([low, high, np.where(qa > 0, side, np.inf)])
    first = shares.argmin(axis=0)
    return shares.min(axis=0), np.array([LOW, HIGH, FREE], np.int8)[first]


def clip(nodes: np.ndarray, edges: np.ndarray, body: Specimen) -> Skeleton:
    """Cut the edges that leave the specimen; each cut end is a node of its own.

    nodes (n, 3) in voxels, edges (e, 2). Edges without an end inside fall out, and so do those of
    which no more than SNAP is left.
    """
    nodes, kind = snap(nodes, body)
    inside = body.inside(nodes) & (kind == JUNCTION)
    on_platen = (kind != JUNCTION) & (np.hypot(*(nodes - body.centre)[:, ::2].T) < body.radius)
    kept = edges[(inside | on_platen)[edges].all(axis=1) & inside[edges].any(axis=1)]
    cut = edges[inside[edges].sum(axis=1) == 1]
    cut = np.where(inside[cut[:, :1]], cut, cut[:, ::-1])
    cut = cut[~on_platen[cut[:, 1]]]
    share, end = exit_share(nodes[cut[:, 0]], nodes[cut[:, 1]], body)
    tip = nodes[cut[:, 0]] + share[:, None] * (nodes[cut[:, 1]] - nodes[cut[:, 0]])
    long = np.linalg.norm(tip - nodes[cut[:, 0]], axis=1) > SNAP
    cut, tip, end = cut[long], tip[long], end[long]
    added = np.c_[cut[:, 0], len(nodes) + np.arange(len(cut))]
    nodes, edges, kind = compact(np.r_[nodes, tip], np.r_[kept, added], np.r_[kind, end])
    return Skeleton(nodes, kind, edges)


def dots(skeleton: Skeleton, spacing: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 3) along all struts and the strut (n,) of each."""
    count = np.ceil(edge_length(skeleton.nodes, skeleton.edges) / spacing).astype(int) + 1
    edge = np.repeat(np.arange(len(count)), count)
    rank = np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count)
    a, b = skeleton.nodes[skeleton.edges[edge]].swapaxes(0, 1)
    return a + (rank / (count[edge] - 1))[:, None] * (b - a), edge


def drop_touching(skeleton: Skeleton) -> Skeleton:
    """Drop the cut struts that would touch a strut they do not meet.

    Surfaces that touch in the reference and part later belong to two motions at once.
    """
    points, edge = dots(skeleton)
    pairs = edge[cKDTree(points).query_pairs(CLEARANCE, output_type="ndarray")]
    ends = skeleton.edges[pairs]
    apart = ~(ends[:, 0, :, None] == ends[:, 1, None, :]).any(axis=(1, 2))
    close = np.unique(pairs[apart & (pairs[:, 0] != pairs[:, 1])])
    cut = close[(skeleton.kind[skeleton.edges[close]] == FREE).any(axis=1)]
    kept = np.delete(skeleton.edges, cut, axis=0)
    nodes, edges, kind = compact(skeleton.nodes, kept, skeleton.kind)
    return Skeleton(nodes, kind, edges)


def largest_component(skeleton: Skeleton) -> Skeleton:
    """The largest connected part of nodes (n, 3) and edges (s, 2), renumbered.

    Raises ValueError where less than three of its struts reach one of the platens.
    """
    n = len(skeleton.nodes)
    graph = coo_array((np.ones(len(skeleton.edges)), skeleton.edges.T), shape=(n, n))
    _, part = connected_components(graph, directed=False)
    kept = part[skeleton.edges[:, 0]] == np.bincount(part).argmax()
    nodes, edges, kind = compact(skeleton.nodes, skeleton.edges[kept], skeleton.kind)
    for k, name in ((LOW, "lower"), (HIGH, "upper")):
        if np.sum(kind == k) < 3:
            raise ConfigError(
                f"only {np.sum(kind == k)} struts reach the {name} platen, at least 3 are needed; "
                "choose another twin seed, a larger size or a smaller cell_size"
            )
    return Skeleton(nodes, kind, edges)


def make_skeleton(options: TwinOptions) -> Skeleton:
    """Straight struts of the foam within the specimen."""
    body = specimen(options)
    return largest_component(drop_touching(clip(*open_network(options, body), body)))
