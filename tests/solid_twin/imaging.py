"""Scans of the solid: occupancy of the deformed elements, blur of the scanner, noise."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter

from solid_twin.fixture import Record
from solid_twin.raster import occupancy


@dataclass(frozen=True)
class Imaging:
    """Grey levels of void, foam and platens; `psf`: sigma of the blur, voxels; `noise`: standard
    deviation in grey levels; `grain`: sigma of its correlation, voxels; `sampling`: grid points
    per voxel and axis."""

    void: float = 20.0
    foam: float = 110.0
    platen: float = 150.0
    psf: float = 0.7
    noise: float = 4.0
    grain: float = 0.5
    sampling: int = 3
    seed: int = 2417


def platen_share(count: int, faces: tuple[float, float]) -> np.ndarray:
    """(count,) share of each layer of voxels along y that lies in a platen."""
    y = np.arange(count)
    return np.clip(faces[0] - y + 0.5, 0, 1) + np.clip(y + 0.5 - faces[1], 0, 1)


def correlated_noise(shape: tuple[int, ...], imaging: Imaging, state: int) -> np.ndarray:
    """Noise of the given deviation, Gaussian, blurred by `grain`."""
    rng = np.random.default_rng([imaging.seed, 7, state])
    field = gaussian_filter(rng.standard_normal(shape), imaging.grain, mode="wrap")
    return imaging.noise * field / field.std()


def clean_image(compression: Record, state: int, imaging: Imaging) -> tuple[np.ndarray, float]:
    """Grey levels (nx, ny, nz) of a state without noise, 0 for the reference, and the share of the
    solid that is there twice."""
    mesh, shape = compression.mesh, compression.foam.shape
    u = compression.displacements[state - 1] if state else 0.0
    solid, twice = occupancy(mesh, mesh.points + u, shape, imaging.sampling)
    platen = platen_share(shape[1], compression.platens[state])[:, None]
    grey = (imaging.void + (imaging.foam - imaging.void) * solid) * (1 - platen)
    grey += imaging.platen * platen
    return gaussian_filter(grey, imaging.psf, mode="nearest"), twice


def eight_bit(grey: np.ndarray) -> np.ndarray:
    """uint8, as most scanners store it."""
    return np.clip(np.rint(grey), 0, 255).astype(np.uint8)


def scan(compression: Record, state: int, imaging: Imaging) -> np.ndarray:
    """The scan (nx, ny, nz) uint8 of a state, 0 for the reference."""
    grey, _ = clean_image(compression, state, imaging)
    return eight_bit(grey + correlated_noise(grey.shape, imaging, state))
