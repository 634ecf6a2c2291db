"""From networks and motions to the arrays of the compiled kernels."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from . import kernels
from .kernels import Beams, Bent, Cells
from .motion import Motion
from .struts import Network

CELL = 2.5
"""Edge of a cell of the list of near elements, voxels; wider for large images."""

REACH = 2.5
"""Points this near to a surface find their elements in the list, others in a tree (voxels)."""

FAR_COUNT = 24
"""Nearest elements that are considered for points out of reach."""


def beams(network: Network) -> Beams:
    """The reference of all elements."""
    start = network.nodes[network.elements[:, 0]]
    chord = network.nodes[network.elements[:, 1]] - start
    length2 = np.sum(chord**2, axis=1)
    second = np.cross(chord, network.director) / np.sqrt(length2)[:, None]
    return Beams(start, chord, 1 / length2, network.radii, network.director, second)


def bend(network: Network, motion: Motion) -> Bent:
    """One state of all elements: ends, tangents R D L, rotation of the first end, twist."""
    pair = motion.rotations[network.elements]
    chord = network.nodes[network.elements[:, 1]] - network.nodes[network.elements[:, 0]]
    twist = Rotation.from_matrix(np.swapaxes(pair[:, 0], 1, 2) @ pair[:, 1]).as_rotvec()
    low, high = network.body.low, network.body.high
    return Bent(
        motion.positions[network.elements],
        np.einsum("eaij,ej->eai", pair, chord),
        np.ascontiguousarray(pair[:, 0]),
        np.ascontiguousarray(twist),
        np.array([low, high, motion.platens[1] - high]),
    )


def bounds(b: Beams, p: Bent, band: float) -> tuple[np.ndarray, np.ndarray]:
    """Boxes (m, 2, 3) around the deformed elements and their reach (m,) from the straight segment.

    The curve r(t) lies in the hull of its Bezier points: the ends and those next to them.
    """
    inner = p.ends + np.array([1, -1])[:, None] * p.tangents / 3
    control = np.concatenate([p.ends, inner], axis=1)
    thick = b.radii.max(axis=1) * (1 + kernels.LOBE) + band
    box = np.stack([control.min(axis=1), control.max(axis=1)], axis=1)
    box += thick[:, None, None] * np.array([-1, 1])[:, None]
    straight = p.ends[:, :1] + np.array([1, 2])[:, None] / 3 * np.diff(p.ends, axis=1)
    sag = np.linalg.norm(inner - straight, axis=2).max(axis=1)
    return box, thick + sag


def cell_list(b: Beams, shape: tuple[int, int, int]) -> Cells:
    """Elements that may carry weight at a point within REACH of a surface, for each cell."""
    size = CELL if np.prod(shape) < 2e7 else 1.6 * CELL
    count = np.ceil(np.array(shape) / size).astype(np.int64)
    reach = REACH + kernels.WINDOW
    number = np.zeros(int(np.prod(count)), np.int64)
    kernels.visit_cells(b, size, count, reach, number, np.zeros(0, np.int32))
    first = np.concatenate([[0], np.cumsum(number)])
    listed = np.zeros(first[-1], np.int32)
    kernels.visit_cells(b, size, count, reach, first[:-1].copy(), listed)
    return Cells(size, count, first, listed)


def far_list(b: Beams, points: np.ndarray, tree: cKDTree) -> Cells:
    """A list of its own for each of points (n, 3): the elements with the nearest middles."""
    k = min(FAR_COUNT, len(b.start))
    _, near = tree.query(points, k=k, workers=-1)
    first = np.arange(len(points) + 1, dtype=np.int64) * k
    return Cells(1.0, np.ones(3, np.int64), first, near.astype(np.int32).ravel())
