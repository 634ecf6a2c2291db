"""Tetrahedra from the image itself, on a body-centred cubic lattice [Labelle & Shewchuk 2007].

The level set of the blurred grey level is cut out of a lattice of congruent tetrahedra: lattice
points too near the surface are moved onto it, so that no sliver can arise; the others that the
surface separates give cut points on the edges between them. Nothing is iterated, two runs give the
same mesh, and the dihedral angles are bounded from below by construction.

Why not pytetwild here: at 76,000 surface triangles (default twin) one pass of its optimiser took
433 s and left angles of 1.5 degrees; without optimisation 33 s, angles of 0 degrees. The lattice
takes seconds. pytetwild stays available (`mesh.backend`).

Lattice: corners of cubes of side a, and their centres. Each face of a cube, between two centres,
gives four tetrahedra (both centres and one edge of the face).
"""

import numpy as np
from scipy import ndimage
from scipy.spatial import cKDTree

from addvc.fem.mesh import TET_EDGES, Mesh, oriented
from addvc.geometry.surface import bordered
from addvc.images.spline import interpolating_coefficients

NEAR_LONG, NEAR_SHORT = 0.24, 0.40  # of the edge: a lattice point is moved onto a nearer cut
NECK = 0.65  # of the spacing: the least radius of a strut
BORDER = 2  # voxels around the image, below the threshold as far as its last ones are above it


def stuff(grey: np.ndarray, gamma: float, spacing: float, neck: float = NECK) -> Mesh:
    """Tetrahedra of {grey > gamma} for a volume (nx, ny, nz), lattice cubes of side `spacing`.

    The grey level between voxels is the cubic spline through them; solid ends with the image, half a
    voxel beyond the centres of its last voxels. A strut thinner than the
    lattice would fall between its points: along the skeleton of the solid the radius is at least
    `neck` x spacing, which keeps rods of radius 1 whole up to a spacing of 1.2.
    Cells may be in several pieces; their mean volume is about spacing**3 / 14."""
    field = _Field(grey, gamma, neck * spacing)
    points, cells = _lattice(grey.shape, spacing)
    value = field(points)
    cells = cells[(value[cells] > 0).any(axis=1)]
    points, value, cells = _compact(points, value, cells)
    edges = np.unique(np.sort(cells[:, TET_EDGES].reshape(-1, 2), axis=1), axis=0)
    crossing = edges[value[edges[:, 0]] * value[edges[:, 1]] < 0]
    share = _cut(field, points, value, crossing)
    points, value = _warp(points, value, crossing, share, spacing)
    still = value[crossing[:, 0]] * value[crossing[:, 1]] < 0
    crossing = crossing[still]
    start, stop = points[crossing[:, 0]], points[crossing[:, 1]]
    cuts = start + _cut(field, points, value, crossing)[:, None] * (stop - start)
    tets = _clip(cells, np.sign(value).astype(np.int8), crossing, len(points))
    points, _, tets = _compact(np.vstack([points, cuts]), None, tets)
    return oriented(Mesh(points, tets))


class _Field:
    """The height above gamma (`surface.bordered`) at points (n, 3), at least that of a tube of radius
    `neck` around the skeleton of the solid; what is outside of the image is below zero."""

    def __init__(self, grey, gamma, neck):
        self.coefficients = interpolating_coefficients(bordered(grey, gamma, BORDER), 3)
        solid, self.neck = grey > gamma, neck
        self.skeleton = cKDTree(skeleton_points(solid)) if neck > 0 and solid.any() else None

    def __call__(self, points):
        value = ndimage.map_coordinates(
            self.coefficients,
            points.T + BORDER,
            order=3,
            prefilter=False,
            output=np.float32,
            mode="constant",
            cval=-1.0,
        )
        if self.skeleton is not None:
            low = np.flatnonzero(value < self.neck)
            away, _ = self.skeleton.query(points[low], distance_upper_bound=2 * self.neck)
            value[low] = np.maximum(value[low], self.neck - np.minimum(away, 2 * self.neck))
        return np.where(value == 0, np.float32(-1e-6), value)


def skeleton_points(solid: np.ndarray) -> np.ndarray:
    """Voxels (n, 3) of the skeleton of a solid and the middles between neighbours, in voxels."""
    from skimage.morphology import skeletonize  # slow to load, and needed here only

    line = np.argwhere(skeletonize(solid)).astype(float)
    pairs = cKDTree(line).query_pairs(1.8, output_type="ndarray")
    return np.vstack([line, line[pairs].mean(axis=1)])


def _lattice(shape, a):
    """Points of a body-centred cubic lattice over an image, and its tetrahedra."""
    count = [int(np.floor((n - 1) / a)) + 2 for n in shape]
    corner = np.stack(np.meshgrid(*(np.arange(c + 1) for c in count), indexing="ij"), -1)
    centre = np.stack(np.meshgrid(*(np.arange(c) for c in count), indexing="ij"), -1) + 0.5
    number = np.arange(np.prod(np.array(count) + 1)).reshape(np.array(count) + 1)
    middle = number.size + np.arange(np.prod(count)).reshape(count)
    cells = []
    for d in range(3):
        left = np.delete(middle, -1, axis=d).ravel()
        right = np.delete(middle, 0, axis=d).ravel()
        ring = []  # the corners of the face between two centres, in turn
        for p, q in ((0, 0), (1, 0), (1, 1), (0, 1)):
            index = [slice(0, c) for c in count]
            index[d] = slice(1, count[d])
            for axis, shift in zip([x for x in range(3) if x != d], (p, q), strict=True):
                index[axis] = slice(shift, shift + count[axis])
            ring.append(number[tuple(index)].ravel())
        cells += [np.column_stack([left, right, ring[n], ring[(n + 1) % 4]]) for n in range(4)]
    points = np.vstack([corner.reshape(-1, 3), centre.reshape(-1, 3)]) * a - 0.5 * a
    return points, np.vstack(cells)


def _compact(points, value, cells):
    """Keep the points that cells use."""
    used, renumbered = np.unique(cells, return_inverse=True)
    return points[used], None if value is None else value[used], renumbered.reshape(cells.shape)


def _cut(field, points, value, edges, steps=3):
    """Share (e,) of the way along edges (e, 2) where the field is zero: bracketed secant steps."""
    start, along = points[edges[:, 0]], points[edges[:, 1]] - points[edges[:, 0]]
    low, high = np.zeros(len(edges)), np.ones(len(edges))
    f_low, f_high = value[edges[:, 0]].astype(float), value[edges[:, 1]].astype(float)
    for _ in range(steps):
        share = low + (high - low) * f_low / (f_low - f_high)
        f = field(start + share[:, None] * along)
        same = f * f_low > 0
        low, f_low = np.where(same, share, low), np.where(same, f, f_low)
        high, f_high = np.where(same, high, share), np.where(same, f_high, f)
    return low + (high - low) * f_low / (f_low - f_high)


def _warp(points, value, crossing, share, spacing):
    """Move each lattice point onto its nearest cut where that is nearer than the limit."""
    along = points[crossing[:, 1]] - points[crossing[:, 0]]
    length = np.linalg.norm(along, axis=1)
    limit = np.where(length > 0.95 * spacing, NEAR_LONG, NEAR_SHORT)
    node = np.concatenate([crossing[:, 0], crossing[:, 1]])
    part = np.concatenate([share, 1 - share])
    target = np.tile(points[crossing[:, 0]] + share[:, None] * along, (2, 1))
    near = np.flatnonzero(part < np.tile(limit, 2))
    near = near[np.lexsort((part[near] * np.tile(length, 2)[near], node[near]))]
    moved, first = np.unique(node[near], return_index=True)
    points, value = points.copy(), value.copy()
    points[moved], value[moved] = target[near[first]], 0
    return points, value


def _clip(cells, sign, crossing, first):
    """Tetrahedra of the positive part of each cell; cut e of `crossing` is node first + e."""
    key = np.sort(crossing, axis=1) @ np.array([first, 1])
    order = np.argsort(key)

    def cut(p, m):
        wanted = np.minimum(p, m).astype(np.int64) * first + np.maximum(p, m)
        return first + order[np.searchsorted(key, wanted, sorter=order)]

    # corners in the order plus, zero, minus, each group by number: diagonals of shared faces agree
    rank = np.lexsort((cells, -sign[cells]), axis=1)
    cells = np.take_along_axis(cells, rank, axis=1)
    plus, minus = ((sign[cells] == s).sum(axis=1) for s in (1, -1))
    out = [cells[(plus > 0) & (minus == 0)]]
    for zeros in range(3):
        a, *rest = cells[(plus == 1) & (minus == 3 - zeros) & (minus > 0)].T
        out.append(np.column_stack([a, *rest[:zeros], *(cut(a, m) for m in rest[zeros:])]))
    a, b, z, m = cells[(plus == 2) & (minus == 1)].T
    out += [np.column_stack([a, b, cut(b, m), z]), np.column_stack([a, cut(b, m), cut(a, m), z])]
    a, b, m, n = cells[(plus == 2) & (minus == 2)].T
    out += _prism((a, cut(a, m), cut(a, n)), (b, cut(b, m), cut(b, n)))
    a, b, c, m = cells[(plus == 3) & (minus == 1)].T
    out += _prism((a, b, c), (cut(a, m), cut(b, m), cut(c, m)))
    return np.vstack(out)


def _prism(low, high):
    """Three tetrahedra of a prism whose diagonals leave from the earlier corner of `low`."""
    return [np.column_stack([*low[: n + 1], *high[n:]]) for n in (2, 1, 0)]
