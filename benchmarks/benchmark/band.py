"""A foam that gives way in one tilted band, smoothly: u = -strain w tanh((n.x - c) / w) along y.

The image without noise is warped, then both get noise. The truth is u itself at the nodes of a mesh
of the solid, close enough for linear interpolation (some thousandths of a voxel).
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy import ndimage

from addvc.analysis.mesh_truth import save_mesh_truth
from addvc.images.spline import interpolating_coefficients
from addvc.twin import image, make_foam
from addvc.twin.imaging import noise
from addvc.twin.motion import at_rest
from benchmark.pairs import PairOptions, cube
from solid_twin.bone import mesh_of
from solid_twin.scans import write_stack

SPACING, THRESHOLD = 1.5, 45.0
"""Lattice (voxels) and grey level of the mesh that carries the truth, a little outside of the solid."""


@dataclass(frozen=True)
class Band:
    """Peak `strain`, half `width` and `tilt` (degrees) of the band; `middle` of the cube."""

    strain: float = 0.22
    width: float = 12.0
    tilt: float = 20.0
    middle: float = 47.5

    @property
    def normal(self) -> np.ndarray:
        tilt = np.deg2rad(self.tilt)
        return np.array([np.sin(tilt), np.cos(tilt), 0.0])

    def along(self, s: np.ndarray) -> np.ndarray:
        """u_y at distances s from the plane of the band."""
        return -self.strain * self.width * np.tanh(s / self.width)

    def displacement(self, x: np.ndarray) -> np.ndarray:
        """u (n, 3) at points (n, 3) of the reference."""
        u = np.zeros_like(x, dtype=float)
        u[:, 1] = self.along((x - self.middle) @ self.normal)
        return u

    def pulled_back(self, y: np.ndarray) -> np.ndarray:
        """The points x (n, 3) with x + u(x) = y: s + n_y u_y(s) grows with s."""
        s = np.linspace(-200, 200, 40001)
        found = np.interp((y - self.middle) @ self.normal, s + self.normal[1] * self.along(s), s)
        x = y.astype(float)
        x[:, 1] -= self.along(found)
        return x


def carried(volume: np.ndarray, band: Band) -> np.ndarray:
    """The image (nx, ny, nz) moved by the band, cubic splines, nearest voxel beyond the border."""
    y = np.stack(np.indices(volume.shape), -1).reshape(-1, 3)
    x = np.clip(band.pulled_back(y), 0, np.array(volume.shape) - 1)
    c = interpolating_coefficients(volume)
    return ndimage.map_coordinates(c, x.T, order=3, prefilter=False).reshape(volume.shape)


def write_band(folder: Path, options: PairOptions, band: Band) -> None:
    """state0.tif, state1.tif and truth.h5, for a configuration with `scans`."""
    twin = replace(options.twin(), noise=0.0, dtype="float32")
    network = cube(make_foam(twin), options.side)
    clean = image(network, at_rest(network), twin, 0)
    for state, volume in enumerate((clean, carried(clean, band))):
        grain = noise(twin, state, 0, len(volume), volume.shape)
        write_stack(
            folder / f"state{state}.tif", (volume + options.noise * grain).astype(np.float32)
        )
    mesh = mesh_of(clean, THRESHOLD, SPACING)
    u = band.displacement(mesh.points)
    save_mesh_truth(folder / "truth.h5", mesh.points, mesh.cells, [u], np.array([band.strain]))
