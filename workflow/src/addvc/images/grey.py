"""Brightness and contrast of a loading state brought to those of the reference, for scans that drift.

Two levels are compared, those of void and of solid: the interquartile means (of whole grey levels,
medians go in steps) of the two classes that the intermeans threshold (Ridler & Calvard 1978) makes of
the voxels between the platens. They do not depend on how many voxels are solid, which compression
changes. Where little is solid there are several such thresholds, the lower ones within the noise of
the void: the highest counts.

A drift matters more than it looks, since robust weights and l_E take the noise for all there is: with
the void of the solid twin at 15 % brighter by 2.8 % of the contrast (.6 of its noise) micro DVC chose an
l_E of 3 voxels in place of 22, and its displacement changed by .31 voxel. Hence "auto".
"""

import logging
from dataclasses import dataclass

import numpy as np
from scipy.stats import median_abs_deviation, trim_mean
from skimage.filters import threshold_isodata

from addvc.errors import ScanError, grey_words
from addvc.images.platens import find_platens

log = logging.getLogger(__name__)

MARGIN = 3  # voxels off the platens, whose faces are blurred
LEAST = 0.2  # of the reference's contrast: less is no scan of the same foam
SAMPLES = 2_000_000  # voxels that are enough for two levels
CLEAR = 2.0  # deviations of the void that the threshold is above it, at least
DRIFT = 0.1  # of the noise of the void: what brightness may drift by; twins have at most .05
GAIN = 0.25  # what the contrast may differ by: thin struts that thicken (`band`) have .18
MIDDLE = 0.25  # of a class, at either end, is left out of its level


@dataclass(frozen=True)
class Levels:
    """Grey levels of void and solid, noise of the void."""

    void: float
    solid: float
    noise: float = 0.0

    @property
    def contrast(self) -> float:
        return self.solid - self.void


def grey_levels(volume: np.ndarray, axis: int) -> Levels:
    """Void and solid of a volume (nx, ny, nz), between its platens along `axis` where it shows any.

    Raises ScanError when all grey levels are the same, or noise hides the solid."""
    faces = find_platens(volume, axis)
    rows = np.moveaxis(volume, axis, 0)
    if faces is not None:
        rows = rows[int(np.ceil(faces[0])) + MARGIN : int(np.floor(faces[1])) + 1 - MARGIN]
    grey = rows.ravel()[:: max(1, rows.size // SAMPLES)]
    if grey.size == 0 or np.ptp(grey) == 0:
        raise ScanError(
            "the grey levels of a scan are all the same between its platens: images.grey cannot match "
            "them; check the scan, or use images.grey: none"
        )
    middle = np.max(threshold_isodata(grey, return_all=True))
    below = grey[grey <= middle]
    void, noise = trim_mean(below, MIDDLE), median_abs_deviation(below, scale="normal")
    if middle < void + CLEAR * noise:
        raise ScanError(
            f"void and solid of a scan cannot be told apart: the threshold between them, {middle:.1f}, "
            f"is within {CLEAR:g} deviations of the void ({grey_words(void)}, noise "
            f"{grey_words(noise)}); raise "
            "scans.bin, or use images.grey: none"
        )
    return Levels(float(void), float(trim_mean(grey[grey > middle], MIDDLE)), float(noise))


def drifts(levels: Levels, wanted: Levels) -> bool:
    """Whether brightness or contrast are clearly not those wanted."""
    gain = levels.contrast / wanted.contrast
    return abs(levels.void - wanted.void) > DRIFT * wanted.noise or abs(gain - 1) > GAIN


def corrected(volume: np.ndarray, reference: np.ndarray, axis: int, setting: str) -> np.ndarray:
    """A state (nx, ny, nz) with the levels of the reference: always ("global"), if it drifts ("auto").

    Raises ScanError where "global" cannot tell void and solid; "auto" then leaves it as it is."""
    try:
        wanted, levels = grey_levels(reference, axis), grey_levels(volume, axis)
    except ScanError as error:
        if setting == "global":
            raise
        log.info("grey levels are left as they are: %s", error)
        return volume
    if setting == "auto" and not drifts(levels, wanted):
        return volume
    if setting == "auto":
        log.warning(
            "WARNING: this scan has void of %.4g and solid of %.4g grey levels, the reference %.4g and "
            "%.4g: brought to these; say images.grey: none to have it as it is",
            levels.void, levels.solid, wanted.void, wanted.solid,
        )  # fmt: skip
    return matched(volume, levels, wanted)


def matched(volume: np.ndarray, levels: Levels, wanted: Levels) -> np.ndarray:
    """The volume (nx, ny, nz) with its two levels moved to those wanted: a I + b, float32.

    Raises ScanError where the contrast is below a fifth of, or over five times, that wanted."""
    ratio = levels.contrast / wanted.contrast
    if not LEAST < ratio < 1 / LEAST:
        raise ScanError(
            f"the contrast of a state is {ratio:.2f} times that of the reference (from {LEAST} to "
            f"{1 / LEAST:g} can be matched): check that both are scans of the same specimen"
        )
    log.info(
        "grey levels: void %.4g, solid %.4g, contrast x %.3f", levels.void, levels.solid, ratio
    )
    return (
        (volume - np.float32(levels.void)) / np.float32(ratio) + np.float32(wanted.void)
    ).astype(np.float32)
