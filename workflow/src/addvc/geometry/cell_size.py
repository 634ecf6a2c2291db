"""Fig. 4: the cell size, where the radially averaged autocorrelation has its secondary peak."""

import numpy as np
from scipy import fft, ndimage

from addvc.errors import GeometryError

LARGEST_BOX = 256


def central_box(specimen, shape: tuple[int, int, int]) -> tuple[slice, slice, slice]:
    """The largest centred box inside the specimen (a square in a circle), at most 256 voxels wide."""
    low, high = np.zeros(3), np.array(shape) - 1.0
    across = [d for d in range(3) if d != specimen.axis]
    low[specimen.axis], high[specimen.axis] = specimen.low + 2, specimen.high - 2
    for n, d in enumerate(across):
        if specimen.kind == "cylinder":
            half = specimen.radius / np.sqrt(2)
            low[d], high[d] = specimen.centre[n] - half, specimen.centre[n] + half
        else:
            low[d], high[d] = specimen.bounds[n]
    excess = np.maximum(high - low - LARGEST_BOX, 0) / 2
    low = np.maximum(np.ceil(low + excess), 0).astype(int)
    high = np.minimum(np.floor(high - excess), np.array(shape) - 1).astype(int)
    return tuple(slice(a, b + 1) for a, b in zip(low, high, strict=True))


def autocorrelation(box: np.ndarray) -> np.ndarray:
    """Normalised autocorrelation (nx, ny, nz) of a box for shifts 0 .. n-1, without wrap-around.

    Each shift is divided by the number of voxel pairs that have it; the value at zero is 1."""
    grey = box.astype(np.float32) - box.mean(dtype=np.float64).astype(np.float32)
    size = [fft.next_fast_len(2 * n) for n in box.shape]
    power = np.abs(fft.rfftn(grey, size)) ** 2
    full = fft.irfftn(power, size)
    # shifts of either sign along y and z: fold them onto positive ones by averaging
    n = box.shape
    folded = full[: n[0], : n[1], : n[2]].copy()
    pairs = [(n[d] - np.arange(n[d])).astype(np.float32) for d in range(3)]
    folded /= pairs[0][:, None, None] * pairs[1][:, None] * pairs[2]
    return folded / folded[0, 0, 0]


def radial_average(correlation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Radii r (voxels, one a voxel, up to half of the smallest side) and the mean around them."""
    reach = min(correlation.shape) // 2
    part = correlation[:reach, :reach, :reach]
    grid = np.arange(reach, dtype=np.float32) ** 2
    radius = np.rint(np.sqrt(grid[:, None, None] + grid[:, None] + grid)).astype(int).ravel()
    total = np.bincount(radius, weights=part.ravel())[:reach]
    return np.arange(reach), total / np.bincount(radius)[:reach]


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
