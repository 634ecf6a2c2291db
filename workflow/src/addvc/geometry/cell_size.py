"""Fig. 4: the cell size, where the radially averaged autocorrelation has its secondary peak."""

import numpy as np
from scipy import fft, ndimage

from addvc.errors import GeometryError

LARGEST_BOX = 200  # voxels: a larger one says nothing more, and its FFT would take gigabytes
PLATEN_MARGIN = 3.0


def central_box(specimen, shape: tuple[int, int, int]) -> tuple[slice, slice, slice]:
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
    """Normalised autocorrelation of a box (nx, ny, nz) inside a mask, for shifts 0 .. n-1.

    Each shift is divided by the number of voxel pairs that have it (nan for none); one at zero."""
    size = [fft.next_fast_len(2 * n) for n in grey.shape]
    centred = np.where(mask, grey - grey[mask].mean(dtype=np.float64), 0).astype(np.float32)
    sums = [fft.irfftn(np.abs(fft.rfftn(part, size)) ** 2, size)[tuple(map(slice, grey.shape))]
            for part in (centred, mask.astype(np.float32))]  # fmt: skip
    pairs = np.where(sums[1] > 0.5, sums[1], np.nan)
    value = sums[0] / pairs
    return value / value[0, 0, 0]


def radial_average(correlation: np.ndarray, share: float = 0.6) -> tuple[np.ndarray, np.ndarray]:
    """Radii (voxels, one a voxel, up to `share` of the smallest side) and the mean around them."""
    reach = int(share * min(correlation.shape))
    part = correlation[:reach, :reach, :reach]
    grid = np.arange(reach, dtype=np.float32) ** 2
    radius = np.rint(np.sqrt(grid[:, None, None] + grid[:, None] + grid)).astype(int)
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
            "is unknown; set geometry.cell_size (voxels of the binned image), or use a larger image"
        )
    top = peaks[np.argmax(smooth[peaks])]
    before, at, after = smooth[top - 1 : top + 2]
    return float(radius[top] + 0.5 * (before - after) / (before - 2 * at + after))


def measure_cell_size(volume: np.ndarray, specimen, setting: str | float) -> dict:
    """The cell size in voxels ("auto": measured; a number: given) and the curve of Fig. 4.

    Raises GeometryError when it must be measured and there is no secondary peak."""
    box = central_box(specimen, volume.shape)
    mask = specimen.voxel_mask(volume.shape)[box]
    radius, curve = radial_average(autocorrelation(volume[box], mask))
    size = secondary_peak(radius, curve) if setting == "auto" else float(setting)
    source = "measured" if setting == "auto" else "config"
    return {"cell_size": size, "source": source, "radius": radius, "correlation": curve,
            "unit": "voxel"}  # fmt: skip
