"""A random open-cell foam as a level set, cut to a cylinder between two platens, and its mesh.

Seeds are spread by Lloyd's iterations in a box larger than the specimen; struts are the edges of
their Voronoi diagram, as rods whose radius grows towards both ends; a smooth minimum of the
distances to all of them makes nodes thick; a smooth random field bends them. Nothing of this is
how `addvc.twin` makes its foam. The mesh is the truth: images are made from it, not from the level
set. Its lattice is turned, so that it has nothing in common with the voxels.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates
from scipy.spatial import Voronoi, cKDTree
from scipy.spatial.transform import Rotation

from addvc.fem.mesh import Mesh
from addvc.geometry.stuffing import stuff
from addvc.geometry.tets import largest_piece

FAR = 3.0
"""Distances beyond it are cut off, voxels."""


@dataclass(frozen=True)
class Foam:
    """Lengths in voxels. `shape`: of the image; `low`, `high`: y of the platens' faces; `radius`: of
    the cylinder; `cell_volume`: per seed; `strut`: radius at mid-span, `scatter` its relative
    deviation, `flare` how much larger it is at the ends; `blend`: length of the smooth minimum;
    `bow`: rms of the field that bends struts, `wave` its length; `spacing`: of the mesh's lattice."""

    shape: tuple[int, int, int] = (96, 110, 96)
    low: float = 9.0
    high: float = 100.0
    radius: float = 37.5
    cell_volume: float = 9600.0
    elongation: float = 1.1
    strut: float = 1.25
    scatter: float = 0.08
    flare: float = 0.15
    blend: float = 0.3
    bow: float = 0.6
    wave: float = 10.0
    spacing: float = 1.75
    sampling: int = 2
    turn: tuple[float, float, float] = (0.4, 0.3, 0.7)
    seed: int = 2417

    @property
    def centre(self) -> np.ndarray:
        """(3,) middle of the image, on the axis of the cylinder."""
        return (np.array(self.shape) - 1) / 2


def seeds(foam: Foam, rng: np.random.Generator, iterations: int = 6) -> np.ndarray:
    """(n, 3) centres of cells in a box around the specimen, evened out by Lloyd's iterations."""
    stretch = np.array([1, foam.elongation, 1]) / foam.elongation ** (1 / 3)
    margin = 1.5 * foam.cell_volume ** (1 / 3)
    box = np.array([2 * foam.radius, foam.high - foam.low, 2 * foam.radius]) + 2 * margin
    box = box / stretch
    x = rng.uniform(0, 1, (round(box.prod() / foam.cell_volume), 3)) * box
    samples = rng.uniform(0, 1, (2000 * len(x), 3)) * box
    for _ in range(iterations):
        owner = cKDTree(x).query(samples)[1]
        count = np.maximum(np.bincount(owner, minlength=len(x)), 1)
        x = np.stack([np.bincount(owner, s, len(x)) / count for s in samples.T], axis=1)
    return (x - box / 2) * stretch + foam.centre


def voronoi_edges(points: np.ndarray) -> np.ndarray:
    """(e, 2, 3) ends of the finite edges of the Voronoi diagram of points (n, 3)."""
    diagram = Voronoi(points)
    pairs = [
        np.column_stack([ridge, np.roll(ridge, -1)])
        for ridge in map(np.array, diagram.ridge_vertices)
    ]
    edges = np.unique(np.sort(np.vstack(pairs), axis=1), axis=0)
    return diagram.vertices[edges[edges[:, 0] >= 0]]


def struts(foam: Foam, rng: np.random.Generator) -> np.ndarray:
    """(e, 2, 3) ends of the edges that come near the specimen, those that are not mere points."""
    edges = voronoi_edges(seeds(foam, rng))
    away = edges.mean(axis=1) - foam.centre
    reach = np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1) / 2 + FAR
    near = np.hypot(away[:, 0], away[:, 2]) < foam.radius + reach
    near &= np.abs(away[:, 1]) < (foam.high - foam.low) / 2 + reach
    return edges[near & (reach > FAR + 0.05)]


def rods(
    edges: np.ndarray, radius: np.ndarray, foam: Foam, shape: tuple[int, ...], bend: np.ndarray
) -> np.ndarray:
    """Smooth minimum of d - r over rods, on a grid of `shape` in grid units; at most FAR.

    edges (e, 2, 3), radius (e,) in grid units; bend (3, ...): what is added to grid points."""
    unit = foam.sampling
    total = np.zeros(shape, np.float32)
    reach = unit * (FAR + foam.strut * (1 + foam.flare) + 3 * foam.bow)
    for (a, b), r in zip(edges, radius, strict=True):
        low = np.clip(np.minimum(a, b) - reach, 0, shape).astype(int)
        high = np.clip(np.maximum(a, b) + reach + 1, 0, shape).astype(int)
        box = tuple(slice(p, q) for p, q in zip(low, high, strict=True))
        x = np.stack(np.mgrid[box], -1) + np.moveaxis(bend[:, *box], 0, -1)
        t = np.clip((x - a) @ (b - a) / np.sum((b - a) ** 2), 0, 1)
        distance = np.linalg.norm(x - a - t[..., None] * (b - a), axis=-1)
        distance -= r * (1 + foam.flare * (2 * t - 1) ** 2)
        total[box] += np.exp(-distance / (unit * foam.blend))
    with np.errstate(divide="ignore"):
        return np.minimum(-foam.blend * np.log(total), FAR)


def bending(foam: Foam, shape: tuple[int, ...], rng: np.random.Generator) -> np.ndarray:
    """(3, ...) smooth random field in grid units, from a grid eight times coarser."""
    coarse = 8
    size = [n // coarse + 2 for n in shape]
    fields = []
    for _ in range(3):
        field = gaussian_filter(rng.standard_normal(size), foam.wave * foam.sampling / coarse / 2)
        field *= foam.bow * foam.sampling / field.std()
        place = np.mgrid[tuple(slice(0, n) for n in shape)].astype(np.float32) / coarse
        fields.append(map_coordinates(field.astype(np.float32), place, order=1))
    return np.stack(fields)


def cut(inside: np.ndarray, foam: Foam, to_voxels: Callable) -> None:
    """Keep, in place, what is within the cylinder and half a voxel into the platens: minimum of the
    grid `inside` and the distances to these faces. to_voxels: grid points (n, 3) -> voxels."""
    half = (foam.high - foam.low) / 2 + 0.5
    for i in range(len(inside)):  # planes, since points of the whole grid would take gigabytes
        plane = np.stack(np.mgrid[i : i + 1, : inside.shape[1], : inside.shape[2]], -1)
        x, y, z = (to_voxels(plane.reshape(-1, 3)) - foam.centre).T
        distance = np.minimum(foam.radius - np.hypot(x, z), half - np.abs(y))
        inside[i] = np.minimum(inside[i], distance.reshape(inside.shape[1:]))


def make_foam(foam: Foam) -> Mesh:
    """Linear tetrahedra of the largest piece, in voxels of the image."""
    rng = np.random.default_rng([foam.seed, 1])
    edges = struts(foam, rng)
    turn = Rotation.from_rotvec(foam.turn)
    half = np.array([foam.radius, (foam.high - foam.low) / 2 + 1, foam.radius]) + FAR
    corners = turn.apply(np.stack(np.meshgrid(*[(-h, h) for h in half]), -1).reshape(-1, 3))
    middle = foam.sampling * np.abs(corners).max(axis=0)
    shape = tuple(int(n) for n in 2 * middle + 1)

    def to_grid(x):
        return foam.sampling * turn.apply(x - foam.centre) + middle

    def to_voxels(x):
        return turn.inv().apply((x - middle) / foam.sampling) + foam.centre

    radius = foam.sampling * foam.strut * np.exp(foam.scatter * rng.standard_normal(len(edges)))
    ends = to_grid(edges.reshape(-1, 3)).reshape(-1, 2, 3)
    inside = -rods(ends, radius, foam, shape, bending(foam, shape, rng))
    cut(inside, foam, to_voxels)
    mesh, _ = largest_piece(stuff(inside, 0.0, foam.sampling * foam.spacing))
    return Mesh(to_voxels(mesh.points), mesh.cells)
