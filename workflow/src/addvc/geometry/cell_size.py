"""Fig. 4: the cell size, where the radially averaged autocorrelation has its secondary peak."""

import logging

import numpy as np
from scipy import fft, ndimage

from addvc.errors import GeometryError
from addvc.images.specimen import Specimen

log = logging.getLogger(__name__)

LARGEST_BOX = 200  # voxels: a larger one says nothing more, and its FFT would take gigabytes
PLATEN_MARGIN = 3.0
FEW = 15  # voxels: half of what the default twin and the paper have
REACH = 0.6  # of the smallest side: longer shifts have few pairs of voxels


def central_box(specimen: Specimen, shape: tuple[int, int, int]) -> tuple[slice, slice, slice]:
    """The box around the specimen without its platens, its centre if over 200 voxels wide."""
    low, high = np.zeros(3), np.array(shape) - 1.0
    low[specimen.axis] = specimen.low + PLATEN_MARGIN
    high[specimen.axis] = specimen.high - PLATEN_MARGIN
    for n, d in enumerate(specimen.across):
        half = specimen.radius
        centre = specimen.centre[n]
        outline = (centre - half, centre + half) if half else specimen.bounds[n]
        low[d], high[d] = outline
    excess = np.maximum(high - low - LARGEST_BOX, 0) / 2
    low = np.clip(np.ceil(low + excess), 0, None).astype(int)
    high = np.minimum(np.floor(high - excess), np.array(shape) - 1).astype(int)
    return tuple(slice(a, b + 1) for a, b in zip(low, high, strict=True))


def autocorrelation(grey: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Normalised autocorrelation of a box (nx, ny, nz) inside a mask, without wrap-around.

    The result (sx, sy, sz) has shift k at index k, negative ones from the end. Each is divided by
    the number of voxel pairs that have it (nan for none); the value at zero is one."""
    size = [fft.next_fast_len(2 * n) for n in grey.shape]
    centred = np.where(mask, grey - grey[mask].mean(dtype=np.float64), 0).astype(np.float32)
    products, pairs = (
        fft.irfftn(np.abs(fft.rfftn(part, size)) ** 2, size)
        for part in (centred, mask.astype(np.float32))
    )
    value = products / np.where(pairs > 0.5, pairs, np.nan)
    return value / value[0, 0, 0]


def radial_average(correlation: np.ndarray, reach: int) -> tuple[np.ndarray, np.ndarray]:
    """Radii 0 .. reach - 1 (voxels) and the mean of an autocorrelation over all directions."""
    lags = [np.minimum(np.arange(n), n - np.arange(n)) for n in correlation.shape]
    near = np.ix_(*(lag < reach for lag in lags))
    x, y, z = (lag[lag < reach].astype(np.float32) ** 2 for lag in lags)
    radius = np.rint(np.sqrt(x[:, None, None] + y[:, None] + z)).astype(int)
    part = correlation[near]
    known = np.isfinite(part)
    total = np.bincount(radius[known], weights=part[known])[:reach]
    return np.arange(reach), total / np.bincount(radius[known])[:reach]


def secondary_peak(radius: np.ndarray, curve: np.ndarray) -> float:
    """Radius of the highest maximum after the first minimum, refined by a parabola.

    Raises GeometryError when the curve falls to its end without rising again."""
    smooth = ndimage.gaussian_filter1d(curve, 1.5)
    rising = np.flatnonzero(np.diff(smooth) > 0)
    first = int(rising[0]) if len(rising) else len(smooth)
    inner = np.arange(first + 1, len(smooth) - 1)
    peaks = inner[(smooth[inner] >= smooth[inner - 1]) & (smooth[inner] > smooth[inner + 1])]
    if len(peaks) == 0:
        raise GeometryError(
            f"the autocorrelation has no secondary peak up to {radius[-1]} voxels, so the cell size "
            "is unknown; lower scans.bin, set geometry.cell_size (voxels of the binned image), or use a "
            "larger image"
        )
    top = peaks[np.argmax(smooth[peaks])]
    before, at, after = smooth[top - 1 : top + 2]
    return float(radius[top] + 0.5 * (before - after) / (before - 2 * at + after))


def measure_cell_size(volume: np.ndarray, specimen: Specimen, setting: str | float) -> dict:
    """The cell size in voxels ("auto": measured; a number: given) and the curve of Fig. 4.

    Warns where it is below FEW. Raises GeometryError when it must be measured and there is no secondary
    peak."""
    box = central_box(specimen, volume.shape)
    mask = specimen.voxel_mask(volume.shape)[box]
    reach = int(REACH * min(mask.shape))
    radius, curve = radial_average(autocorrelation(volume[box], mask), reach)
    size = secondary_peak(radius, curve) if setting == "auto" else float(setting)
    source = "measured" if setting == "auto" else "config"
    if size < FEW:
        log.warning(
            "WARNING: a cell is %.1f voxels wide (at least %d; 25 to 40 are good), so that its struts "
            "have hardly a voxel across and no result of micro DVC can be trusted; lower scans.bin, or "
            "give geometry.cell_size where it is not this", size, FEW,
        )  # fmt: skip
    return {
        "cell_size": size,
        "source": source,
        "radius": radius,
        "correlation": curve,
        "unit": "voxel",
    }
