"""The solid as a network: branches of its skeleton between the junctions where struts meet.

Thinning (scikit-image) leaves lines of voxels; voxels with three neighbours or more are junctions,
the lines between them branches. What thinning makes up is taken back: clusters of junction voxels
nearer than a strut is thick are one junction, and ends shorter than a strut is wide are no struts.
"""

import logging
from dataclasses import dataclass

import numpy as np
from scipy import ndimage, sparse
from scipy.sparse.csgraph import breadth_first_order, connected_components
from scipy.spatial import cKDTree
from skimage.morphology import skeletonize

log = logging.getLogger(__name__)

NEIGHBOUR = 1.8
"""Voxels: beyond the 26 neighbours' sqrt(3), below 2."""

NEAR_END = 5
"""Points of a branch that tell its direction at an end."""

STRAIGHT_ON = np.cos(np.radians(40))
"""Two branches that meet alone and turn by less are one strut; others met at a junction whose third
strut the threshold has lost."""

FREE_END = -1
"""In place of a junction, where a branch ends."""


@dataclass(frozen=True, eq=False)
class Branch:
    """A line of points (k, 3) in voxels between junctions `ends`, FREE_END for none."""

    points: np.ndarray
    ends: tuple[int, int]

    @property
    def length(self) -> float:
        """Along the line, voxels."""
        return float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).sum())


@dataclass(frozen=True, eq=False)
class StrutGraph:
    """Junctions (j, 3) with the radius (j,) of the largest ball that the solid holds there, and the
    branches between them; voxels."""

    junctions: np.ndarray
    radii: np.ndarray
    branches: list[Branch]


def strut_graph(solid: np.ndarray) -> StrutGraph:
    """The graph of a solid (nx, ny, nz) of bool, points in voxels; empty, with a warning, where
    nothing meets."""
    depth = ndimage.distance_transform_edt(np.pad(solid, 1))[1:-1, 1:-1, 1:-1]
    voxels = np.argwhere(skeletonize(solid))
    radius = depth[tuple(voxels.T)]
    links = skeleton_links(voxels)
    degree = np.asarray(links.sum(axis=1)).ravel()
    knots = np.flatnonzero(degree > 2)
    if len(knots) == 0:
        log.warning(
            "WARNING: the skeleton of the solid has %d voxels and no junction (at least 1), so that "
            "there are no struts; widen micro.region, or lower the threshold",
            len(voxels),
        )
        return StrutGraph(np.zeros((0, 3)), np.zeros(0), [])
    count, knot = connected_components(links[knots][:, knots], directed=False)
    middles = np.stack([ndimage.mean(x, knot, range(count)) for x in voxels[knots].T], axis=1)
    cluster = np.full(len(voxels), FREE_END)
    cluster[knots] = knot
    branches = skeleton_branches(voxels, links, cluster, middles)
    branches, middles = split_at_kinks(branches, middles)
    thickness = float(np.median(radius))
    ends, branches = simplified(len(middles), branches, 2 * thickness)
    return located(ends, branches, middles, depth)


def skeleton_links(voxels: np.ndarray) -> sparse.csr_matrix:
    """Which voxels (n, 3) are neighbours, (n, n), symmetric."""
    pairs = cKDTree(voxels).query_pairs(NEIGHBOUR, output_type="ndarray")
    n = len(voxels)
    half = sparse.coo_matrix((np.ones(len(pairs), dtype=np.int32), pairs.T), shape=(n, n))
    return (half + half.T).tocsr()


def skeleton_branches(
    voxels: np.ndarray, links: sparse.csr_matrix, cluster: np.ndarray, middles: np.ndarray
) -> list[Branch]:
    """Branches between clusters (n,) of junction voxels, FREE_END elsewhere; rings without a
    junction are left out."""
    lines = np.flatnonzero(cluster == FREE_END)
    among = links[lines][:, lines]
    inner = np.asarray(among.sum(axis=1)).ravel()
    _, label = connected_components(among, directed=False)
    order = np.argsort(label, kind="stable")
    branches = []
    for members in np.split(order, np.flatnonzero(np.diff(label[order])) + 1):
        tips = members[inner[members] < 2]
        if len(tips) == 0:
            continue
        path = lines[members[_walk(among[members][:, members], np.searchsorted(members, tips[0]))]]
        branches += _branch(path, voxels, links, cluster, middles)
    return branches


def _walk(links: sparse.csr_matrix, start: int) -> np.ndarray:
    """Order of the voxels of a line from one of its tips."""
    return breadth_first_order(links, start, directed=False, return_predecessors=False)


def _branch(
    path: np.ndarray,
    voxels: np.ndarray,
    links: sparse.csr_matrix,
    cluster: np.ndarray,
    middles: np.ndarray,
) -> list[Branch]:
    """The branch of a line of voxels (k,), continued to the middles of the junctions at its ends."""
    first, last = (set(cluster[links[tip].indices]) - {FREE_END} for tip in path[[0, -1]])
    if len(path) == 1 and len(first) > 1:
        first, last = {min(first)}, {max(first)}
    elif len(path) == 1:
        last = set()
    ends = tuple(min(end, default=FREE_END) for end in (first, last))
    points = voxels[path].astype(float)
    head = [middles[[ends[0]]]] if ends[0] != FREE_END else []
    tail = [middles[[ends[1]]]] if ends[1] != FREE_END else []
    points = np.vstack([*head, points, *tail])
    return [Branch(points, ends)] if ends != (FREE_END, FREE_END) else []


def split_at_kinks(branches: list[Branch], middles: np.ndarray) -> tuple[list[Branch], np.ndarray]:
    """Branches cut where they turn: a junction is there, of which the threshold has left two struts.

    Returns the pieces and the junctions (j, 3) with those found now."""
    pieces, knots = [], list(middles)
    for branch in branches:
        start, first = branch.ends[0], 0
        for kink in kinks(branch.points):
            pieces.append(Branch(branch.points[first : kink + 1], (start, len(knots))))
            start, first = len(knots), kink
            knots.append(branch.points[kink])
        pieces.append(Branch(branch.points[first:], (start, branch.ends[1])))
    return pieces, np.array(knots)


def kinks(points: np.ndarray) -> list[int]:
    """Where a line (k, 3) turns most, and by more than a strut does, away from its ends."""
    if len(points) <= 2 * NEAR_END:
        return []
    ahead = points[NEAR_END:] - points[:-NEAR_END]
    ahead /= np.maximum(np.linalg.norm(ahead, axis=1, keepdims=True), 1e-12)
    straight = np.einsum("ki,ki->k", ahead[:-NEAR_END], ahead[NEAR_END:])
    lowest = straight == ndimage.minimum_filter1d(straight, 2 * NEAR_END + 1)
    found = np.flatnonzero(lowest & (straight < STRAIGHT_ON)) + NEAR_END
    return [int(k) for k in found[np.diff(found, prepend=-NEAR_END) >= NEAR_END]]


def simplified(count: int, branches: list[Branch], width: float) -> tuple[np.ndarray, list[Branch]]:
    """Ends shorter than `width` pruned, junctions nearer than half of it merged, and branches that
    meet two by two joined, until nothing changes.

    Returns the merged junction (count,) of each junction, and the branches between those."""
    merged = np.arange(count)
    while True:
        before = len(branches)
        branches = [b for b in branches if FREE_END not in b.ends or b.length > width]
        branches, merged = _merge(branches, merged, width / 2)
        branches = _join(branches, count)
        if len(branches) == before:
            return merged, branches


def _merge(
    branches: list[Branch], merged: np.ndarray, near: float
) -> tuple[list[Branch], np.ndarray]:
    """Branches no longer than `near` become part of a junction, short rings vanish."""
    short = [b for b in branches if FREE_END not in b.ends and b.length <= near]
    n = len(merged)
    pairs = np.array([b.ends for b in short], dtype=int).reshape(-1, 2)
    graph = sparse.coo_matrix((np.ones(len(pairs)), pairs.T), shape=(n, n))
    _, label = connected_components(graph, directed=False)
    kept = [b for b in branches if FREE_END in b.ends or b.length > near]
    moved = [_renamed(b, label) for b in kept]
    rings = [b.ends[0] == b.ends[1] != FREE_END and b.length < 4 * near for b in moved]
    return [b for b, ring in zip(moved, rings, strict=True) if not ring], label[merged]


def _renamed(branch: Branch, label: np.ndarray) -> Branch:
    ends = tuple(FREE_END if end == FREE_END else int(label[end]) for end in branch.ends)
    return Branch(branch.points, ends)


def _join(branches: list[Branch], count: int) -> list[Branch]:
    """Two branches that meet where no third does are one."""
    degree = np.bincount([e for b in branches for e in b.ends if e != FREE_END], minlength=count)
    for knot in np.flatnonzero(degree == 2):
        meeting = [b for b in branches if knot in b.ends]
        if len(meeting) != 2:  # a ring
            continue
        first, second = (b if b.ends[side] == knot else _reversed(b) for b, side in
                         zip(meeting, (1, 0), strict=True))  # fmt: skip
        if -_heading(_reversed(first)) @ _heading(second) < STRAIGHT_ON:
            continue
        points = np.vstack([first.points, second.points[1:]])
        joined = Branch(points, (first.ends[0], second.ends[1]))
        branches = [b for b in branches if knot not in b.ends] + [joined]
    return branches


def _heading(branch: Branch) -> np.ndarray:
    """Direction (3,) from the start of a branch to its points some voxels on."""
    away = branch.points[: NEAR_END + 1] - branch.points[0]
    ahead = away[-1]
    return ahead / max(np.linalg.norm(ahead), 1e-12)


def _reversed(branch: Branch) -> Branch:
    return Branch(branch.points[::-1], branch.ends[::-1])


def located(
    merged: np.ndarray, branches: list[Branch], middles: np.ndarray, depth: np.ndarray
) -> StrutGraph:
    """The graph with its junctions numbered anew, each at the mean of what was merged.

    depth (nx, ny, nz): distance of each voxel to the void."""
    used = sorted({end for b in branches for end in b.ends if end != FREE_END})
    number = np.full(merged.max() + 1, FREE_END)
    number[used] = np.arange(len(used))
    group = number[merged]
    ours = group != FREE_END
    points = np.stack(
        [ndimage.mean(x[ours], group[ours], range(len(used))) for x in middles.T], axis=1
    )
    near = np.clip(np.rint(points).astype(int), 0, np.array(depth.shape) - 1)
    radii = ndimage.maximum_filter(depth, size=3)[tuple(near.T)]
    return StrutGraph(points, radii, [_ended(_renamed(b, number), points) for b in branches])


def _ended(branch: Branch, junctions: np.ndarray) -> Branch:
    """The branch with its ends at the junctions."""
    points = branch.points.copy()
    for place, end in zip((0, -1), branch.ends, strict=True):
        if end != FREE_END:
            points[place] = junctions[end]
    return Branch(points, branch.ends)
