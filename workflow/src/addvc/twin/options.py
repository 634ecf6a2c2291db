"""What a synthetic test is made of: every choice, its unit and its default."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from addvc.config import TWIN_SIZES, twin_faults
from addvc.errors import ConfigError

SIZES = TWIN_SIZES

DTYPES = ("uint8", "uint16", "float32")
MATERIALS = ("elastic", "hinging")

PLATEN_SHARE = 0.085
"""Share of the image's height that each platen fills in the reference."""

AIR, AIR_SHARE = 9.0, 0.035
"""Air between the specimen and the side of the image: so many voxels for the free ends that swing
out, and this share of the width for the specimen's bulge."""


@dataclass(frozen=True)
class TwinOptions:
    """Lengths are voxels of the binned image, grey levels those of an 8-bit scan.

    Geometry: `elongation` of the cells along y, initial `bow` of the struts over their length,
    `scatter` of the radius between struts and `roughness` along one, a `band` through the middle
    whose struts are thinner by `weakening` and that is tilted by `tilt` degrees.
    Mechanics: `strains`, the nominal compression of each state; `step`, the largest strain between
    two equilibria; `material`, elastic or hinging: then the bending moment saturates where the
    strain at the surface of a strut passes `hinge_strain`, with a slope of `hardening`.
    Imaging: scans are `bin` times finer than the binned image. `noise`: standard deviation per scan
    voxel. `psf`: Gaussian sigma in scan voxels. `cupping`, `drift`: relative; `rings`: grey levels.
    Zero switches off, as does `partial_volume` (voxels then are solid or void). `dtype`: `uint8` and
    `float32` hold grey levels, `uint16` 100 times them.
    """

    size: str = "default"
    seed: int = 2417
    cell_size: float = 28.0
    porosity: float = 0.96
    elongation: float = 1.2
    bow: float = 0.03
    scatter: float = 0.12
    roughness: float = 0.05
    band: bool = True
    weakening: float = 0.12
    tilt: float = 20.0
    strains: tuple[float, ...] = (0.034, 0.052, 0.123, 0.285)
    step: float = 0.01
    material: str = "elastic"
    hinge_strain: float = 0.02
    hardening: float = 0.03
    bin: int = 1
    noise: float = 4.0
    dtype: str = "uint8"
    psf: float = 0.7
    partial_volume: bool = True
    cupping: float = 0.04
    rings: float = 1.0
    drift: float = 0.01

    def __post_init__(self) -> None:
        object.__setattr__(self, "strains", tuple(float(e) for e in self.strains))
        for failed, message in self._faults():
            if failed:
                raise ConfigError(message)

    @classmethod
    def from_config(cls, config: Mapping[str, Any]) -> TwinOptions:
        """Options from the `twin` section of a config; an unknown key is an error."""
        known = [f.name for f in fields(cls)]
        unknown = sorted(set(config) - set(known))
        if unknown:
            raise ConfigError(f"unknown twin keys {unknown}; the known ones are {known}")
        return cls(**config)

    @property
    def shape(self) -> tuple[int, int, int]:
        """Shape (nx, ny, nz) of the binned image."""
        return SIZES[self.size]

    def _faults(self):
        """Pairs (is it wrong?, what to say)."""
        yield self.size not in SIZES, f"twin size {self.size!r} is none of {sorted(SIZES)}"
        yield self.dtype not in DTYPES, f"twin dtype {self.dtype!r} is none of {DTYPES}"
        yield self.bin < 1 or self.bin != int(self.bin), f"twin bin {self.bin} is no integer >= 1"
        yield from ((True, words) for words in twin_faults(vars(self)))
        yield not 0 < self.step <= 0.05, f"step {self.step} is outside (0, 0.05]; 0.01 is usual"
        yield self.material not in MATERIALS, f"material {self.material!r} is none of {MATERIALS}"
        yield (
            not 0 < self.hinge_strain <= 1,
            f"hinge_strain {self.hinge_strain} is outside (0, 1]; 0.02 is usual",
        )
        yield (
            not 0.01 <= self.hardening <= 1,
            f"hardening {self.hardening} is outside [0.01, 1]; 0.03 is usual, 1 is elastic",
        )
        yield (
            not 0 <= self.weakening < 0.5,
            f"weakening {self.weakening} is outside [0, 0.5): the band would not be meshed",
        )
        for key in ("bow", "scatter", "roughness", "noise", "psf", "cupping", "rings", "drift"):
            value = getattr(self, key)
            yield value < 0, f"{key} {value} is negative; 0 switches it off"


@dataclass(frozen=True)
class Specimen:
    """The cylinder of foam (axis y) and the faces of its platens, voxels of the binned image."""

    shape: tuple[int, int, int]
    low: float
    high: float
    radius: float

    @property
    def height(self) -> float:
        return self.high - self.low

    @property
    def centre(self) -> np.ndarray:
        """(3,) middle of the image, on the axis."""
        return (np.array(self.shape) - 1) / 2

    def inside(self, points: np.ndarray) -> np.ndarray:
        """points (..., 3) -> bool (...): within the cylinder and between the platens."""
        x = points - self.centre
        across = np.hypot(x[..., 0], x[..., 2]) < self.radius
        return across & (points[..., 1] > self.low) & (points[..., 1] < self.high)


def specimen(options: TwinOptions) -> Specimen:
    """The specimen in the reference image; the image covers [-0.5, n - 0.5] on each axis."""
    nx, ny, nz = options.shape
    low = -0.5 + PLATEN_SHARE * ny
    width = min(nx, nz)
    return Specimen(options.shape, low, ny - 1 - low, width / 2 - AIR - AIR_SHARE * width)
