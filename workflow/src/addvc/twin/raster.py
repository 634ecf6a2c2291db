"""Occupancy of a scan's voxels by the deformed struts, slab by slab."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from addvc.errors import ConfigError

from . import kernels
from .geometry import beams, bend, bounds, cell_list
from .motion import Motion, at_rest
from .struts import Network, thicken

SUPERSAMPLING = 2
"""Grid points per scan voxel and axis."""

SLAB_POINTS = 3e7
"""Grid points held in memory at a time."""


def slabs(nx: int, points_per_plane: float, halo: int = 0) -> Iterator[tuple[int, int, int, int]]:
    """Cut nx planes: (start, stop) of each slab, and (start, stop) widened by the halo."""
    thick = max(1, int(SLAB_POINTS / points_per_plane))
    for start in range(0, nx, thick):
        stop = min(start + thick, nx)
        yield start, stop, max(start - halo, 0), min(stop + halo, nx)


class Rasteriser:
    """Struts of one state, ready to be drawn on slabs of a scan `bin` times finer."""

    def __init__(self, network: Network, motion: Motion, bin: int = 1) -> None:
        self.h = 1 / (SUPERSAMPLING * bin)
        self.band = self.h
        self.beams = beams(network)
        self.bent = bend(network, motion)
        self.bounds = bounds(self.beams, self.bent, self.band)
        moved = not np.array_equal(motion.positions, network.nodes)
        self.cells = cell_list(self.beams, network.body.shape) if moved else None
        self.shape = tuple(bin * n for n in network.body.shape)

    def occupancy(self, start: int, stop: int) -> np.ndarray:
        """Solid fraction (stop - start, ny, nz) float32 of the scan's planes [start, stop) in x."""
        s = SUPERSAMPLING
        shape = ((stop - start) * s, self.shape[1] * s, self.shape[2] * s)
        origin = -0.5 + self.h * (0.5 + np.array([start * s, 0, 0]))
        distance = np.full(shape, np.float32(1e3))
        owner = np.full(shape, np.int32(-1))
        args = (origin, self.h, self.band, distance, owner)
        kernels.scatter(self.beams, self.bent, *self.bounds, *args)
        if self.cells is not None:
            kernels.refine(self.beams, self.bent, self.cells, *args)
        out = np.empty((stop - start, *self.shape[1:]), np.float32)
        kernels.block_occupancy(distance, self.h, s, out)
        return out


def solid_fraction(network: Network) -> float:
    """Share of the specimen's volume that is solid in the reference, whole voxels only."""
    body, raster = network.body, Rasteriser(network, at_rest(network))
    nx, ny, nz = body.shape
    y = slice(math.ceil(body.low + 0.5), math.floor(body.high - 0.5) + 1)
    x, z = np.ogrid[:nx, :nz]
    column = np.hypot(x - body.centre[0], z - body.centre[2]) < body.radius
    solid = sum(
        float(raster.occupancy(a, b)[:, y].sum(axis=1, dtype=float)[column[a:b]].sum())
        for a, b, *_ in slabs(nx, ny * nz * SUPERSAMPLING**3)
    )
    return solid / (column.sum() * (y.stop - y.start))


def fit_radius(network: Network, fraction: float, tolerance: float = 0.003) -> Network:
    """Scale all radii so that the solid fraction is met (relative tolerance): secant in logs.

    Raises ValueError where eight steps do not meet it.
    """
    length = network.nodes[network.elements]
    volume = np.pi * network.body.radius**2 * network.body.height
    total = np.linalg.norm(length[:, 1] - length[:, 0], axis=1) @ (network.radii**2).mean(axis=1)
    log, slope = 0.5 * np.log(fraction * volume / (np.pi * total)), 1.9
    previous = None
    for _ in range(8):
        thick = thicken(network, np.exp(log))
        miss = np.log(solid_fraction(thick) / fraction)
        if abs(miss) < tolerance:
            return thick
        if previous is not None:
            slope = np.clip((miss - previous[1]) / (log - previous[0]), 1.2, 2.5)
        previous = (log, miss)
        log = log - miss / slope
    raise ConfigError(
        f"solid fraction {fraction:.4f} not reached (off by {miss:.1%} after 8 steps, limit "
        f"{tolerance:.1%}); choose a porosity nearer to 0.96"
    )
