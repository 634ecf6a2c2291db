"""Virtual states of a real scan: its image warped by a known smooth field, with fresh noise.

The field is given where it is easy to warp with, in the deformed image: I_d(y) = I_r(y - v(y)),
v(y) = -strain / (1 - strain) (y - low) along the loading axis, which shortens the reference by
`strain`, plus waves. The displacement to be found, u(x) with
I_r(x) = I_d(x + u(x)), then solves u = v(x + u), to round-off, by fixed-point iterations.
Lengths in voxels of the binned image.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from scipy import ndimage

from addvc.errors import ConfigError
from addvc.images.files import write_json
from addvc.images.levels import to_coarse
from addvc.images.spline import interpolating_coefficients


@dataclass(frozen=True)
class VirtualField:
    """Strains of the states, waves of an amplitude (at a strain of 0.02) and a wavelength.

    `low`: coordinate along `axis` that the compression leaves in place."""

    strains: tuple[float, ...]
    axis: int
    low: float = 0.0
    amplitude: float = 0.5
    wavelength: float = 80.0

    @property
    def states(self) -> int:
        """How many loading states it has."""
        return len(self.strains)

    def pulled_back(self, y: np.ndarray, state: int) -> np.ndarray:
        """v (n, 3) at points y (n, 3) of the deformed image."""
        strain = self.strains[state - 1]
        wave = 2 * np.pi / self.wavelength
        size = self.amplitude * strain / 0.02
        v = size * np.stack(
            [
                np.sin(wave * y[:, (d + 1) % 3] + 0.7 * d)
                * np.cos(wave * y[:, (d + 2) % 3] - 0.4 * d)
                for d in range(3)
            ],
            1,
        )
        v[:, self.axis] -= strain / (1 - strain) * (y[:, self.axis] - self.low)
        return v

    def displacement(self, points: np.ndarray, state: int) -> np.ndarray:
        """u (n, 3) at points (n, 3) of the reference, voxels: u = v(x + u).

        Raises ConfigError where 200 iterations do not settle: the field folds the image."""
        u = np.zeros_like(points, dtype=float)
        for _ in range(200):
            new = self.pulled_back(points + u, state)
            if np.abs(new - u).max() < 1e-12:
                return new
            u = new
        raise ConfigError(
            f"virtual state {state} folds the image: amplitude {self.amplitude} voxels over waves of "
            f"{self.wavelength}; lower the amplitude or the strain"
        )

    def save(self, path: str | Path) -> None:
        """The parameters, as JSON."""
        write_json(path, asdict(self))

    @classmethod
    def load(cls, path: str | Path) -> VirtualField:
        """What `save` wrote."""
        return cls(**json.loads(Path(path).read_text()))


def warp(
    volume: np.ndarray, field: VirtualField, state: int, bin: int, noise: float, seed: int
) -> np.ndarray:
    """Scan (nx, ny, nz) of a virtual state, in the type of `volume`, at the scan's own resolution.

    The reference is interpolated by cubic splines; beyond its border the nearest voxel is taken."""
    spans = [np.arange(0, n / bin, field.wavelength / 8) for n in volume.shape]
    field.displacement(np.stack(np.meshgrid(*spans, indexing="ij"), -1).reshape(-1, 3), state)
    coefficients = interpolating_coefficients(volume, 3)
    last = np.array(volume.shape) - 1
    rng = np.random.default_rng([seed, state])
    grid = np.stack(
        np.meshgrid(*(np.arange(n, dtype=float) for n in volume.shape[1:]), indexing="ij"), -1
    ).reshape(-1, 2)
    out = np.empty(volume.shape, volume.dtype)
    limits = np.iinfo(volume.dtype) if volume.dtype.kind in "iu" else None
    for i in range(volume.shape[0]):
        y = np.column_stack([np.full(len(grid), float(i)), grid])
        source = y - bin * field.pulled_back(to_coarse(y, bin), state)
        source = np.clip(source, 0, last)
        grey = ndimage.map_coordinates(
            coefficients, source.T, order=3, prefilter=False, mode="mirror", output=np.float32
        )
        grey += noise * rng.standard_normal(len(grey)).astype(np.float32)
        if limits is not None:
            grey = np.clip(np.rint(grey), limits.min, limits.max)
        out[i] = grey.reshape(volume.shape[1:])
    return out
