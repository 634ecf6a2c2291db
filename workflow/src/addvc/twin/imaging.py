"""What the scanner makes of the solid: grey levels, blur, artefacts, noise."""

from __future__ import annotations

import os
from collections.abc import Iterator

import numpy as np
from scipy.ndimage import gaussian_filter, gaussian_filter1d

from addvc.images.files import atomic_path

from .motion import Motion
from .options import TwinOptions
from .raster import SUPERSAMPLING, Rasteriser, slabs
from .struts import Network

BACKGROUND, FOAM, PLATEN = 20.0, 110.0, 150.0
"""Grey levels."""

GREY_SCALE = {"uint8": 1, "uint16": 100, "float32": 1}
"""Stored value of one grey level."""

GRAIN = 0.5
"""Gaussian sigma of the noise's correlation, scan voxels."""

TRUNCATE = 4.0


def platen_share(count: int, bin: int, platens: tuple[float, float]) -> np.ndarray:
    """(count,) share of each scan voxel along y that lies in a platen."""
    lower = -0.5 + np.arange(count) / bin
    low = np.clip((platens[0] - lower) * bin, 0, 1)
    high = np.clip((lower - platens[1]) * bin + 1, 0, 1)
    return (low + high).astype(np.float32)


def grey_levels(occupancy: np.ndarray, platen: np.ndarray) -> np.ndarray:
    """Mixture of air, foam and platen; occupancy (nx, ny, nz), platen (ny,)."""
    p = platen[None, :, None]
    return (BACKGROUND + (FOAM - BACKGROUND) * occupancy) * (1 - p) + PLATEN * p


def radius_map(planes: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """(len(planes), nz) distance from the rotation axis, as a share of half the width."""
    x = 2 * (planes - (shape[0] - 1) / 2) / shape[0]
    z = 2 * (np.arange(shape[2]) - (shape[2] - 1) / 2) / shape[2]
    return np.hypot(x[:, None], z[None, :])


def cupping(radius: np.ndarray, depth: float) -> np.ndarray:
    """Factor 1 - depth on the axis, 1 at the side: beam hardening; radius (n, nz) of `radius_map`."""
    return (1 - depth * np.clip(1 - radius**2, 0, 1)).astype(np.float32)


def ring_profile(options: TwinOptions, ny: int, width: int) -> np.ndarray:
    """(ny, width) offsets per detector row and distance from the axis; the same in all scans."""
    rng = np.random.default_rng([options.seed, 3])
    field = gaussian_filter(rng.standard_normal((ny, width)), (4.0, 0.8), mode="wrap")
    return (options.rings * field / field.std()).astype(np.float32)


def add_rings(grey: np.ndarray, radius: np.ndarray, profile: np.ndarray) -> None:
    """Add profile (ny, width) at the ring of each voxel, in place; radius (nx, nz)."""
    ring = np.minimum((radius / np.sqrt(2) * profile.shape[1]).astype(int), profile.shape[1] - 1)
    grey += profile[:, ring].transpose(1, 0, 2)


def noise(options: TwinOptions, state: int, lo: int, hi: int, shape: tuple[int, ...]) -> np.ndarray:
    """Correlated noise (hi - lo, ny, nz) of unit deviation, float32, on the planes [lo, hi) along x of a
    scan of `shape` (nx, ny, nz), scan voxels; each plane has its own seed.
    """
    margin = int(TRUNCATE * GRAIN + 0.5)
    planes = [
        np.random.default_rng([options.seed, 4, state, margin + i]).standard_normal(
            shape[1:], dtype=np.float32
        )
        for i in range(lo - margin, hi + margin)
    ]
    white = np.stack(planes)
    field = gaussian_filter(white, GRAIN, mode="wrap", truncate=TRUNCATE)
    impulse = np.zeros(2 * margin + 1)
    impulse[margin] = 1
    gain = np.sum(gaussian_filter1d(impulse, GRAIN, truncate=TRUNCATE) ** 2) ** 1.5
    return field[margin:-margin] / np.float32(gain)


def brightness(options: TwinOptions, state: int) -> float:
    """Intensity of a scan over that of the reference: drifts by at most options.drift."""
    if state == 0:
        return 1.0
    return 1 + options.drift * np.random.default_rng([options.seed, 5, state]).uniform(-1, 1)


def store_as(grey: np.ndarray, dtype: str) -> np.ndarray:
    """Grey levels (any shape) in the scan's data type: times GREY_SCALE, rounded and clipped to what it
    holds, unless it is float32.
    """
    if dtype == "float32":
        return grey.astype(np.float32)
    return np.clip(np.rint(grey * GREY_SCALE[dtype]), 0, np.iinfo(dtype).max).astype(dtype)


def image(network: Network, motion: Motion, options: TwinOptions, state: int) -> np.ndarray:
    """Scan (bin nx, bin ny, bin nz) of one state, axes x, y, z; state 0 is the reference."""
    raster = Rasteriser(network, motion, options.bin)
    shape = raster.shape
    out = np.empty(shape, options.dtype)
    platen = platen_share(shape[1], options.bin, motion.platens)
    rings = ring_profile(options, shape[1], max(shape[0], shape[2]))
    halo = int(TRUNCATE * options.psf + 0.5)
    plane = shape[1] * shape[2] * SUPERSAMPLING**3
    for start, stop, lo, hi in slabs(shape[0], plane, halo):
        solid = raster.occupancy(lo, hi)
        if not options.partial_volume:
            solid = (solid > 0.5).astype(np.float32)
        grey = grey_levels(solid, platen)
        grey = gaussian_filter(grey, options.psf, mode="nearest", truncate=TRUNCATE)
        grey = grey[start - lo : stop - lo] * np.float32(brightness(options, state))
        radius = radius_map(np.arange(start, stop), shape)
        grey *= cupping(radius, options.cupping)[:, None, :]
        if options.rings:
            add_rings(grey, radius, rings)
        if options.noise:
            grey += np.float32(options.noise) * noise(options, state, start, stop, shape)
        out[start:stop] = store_as(grey, options.dtype)
    return out


def pages(volume: np.ndarray) -> Iterator[np.ndarray]:
    """Pages (ny, nx) of a volume (nx, ny, nz), one per z."""
    for k in range(volume.shape[2]):
        yield np.ascontiguousarray(volume[:, :, k].T)


def write_scan(path: str | os.PathLike, volume: np.ndarray) -> None:
    """Multi-page TIFF of a volume (nx, ny, nz): page = z, row = y, column = x; atomic."""
    import tifffile  # loaded where it is needed: a truth is read without

    with atomic_path(path) as temporary:
        tifffile.imwrite(
            temporary,
            pages(volume),
            shape=volume.shape[::-1],
            dtype=volume.dtype,
            bigtiff=volume.nbytes > 3_000_000_000,
            photometric="minisblack",
            metadata={"axes": "ZYX"},
        )
