"""The voxels of solid that struts are found from: with the thin ones, but no noise.

The threshold for the porosity is that of the blurred image. Blur takes the grey level of thin struts
away, so the image as scanned, at a lower threshold, keeps most of them; but it has more noise. It is
taken where its noise stays below the lower threshold, else the blurred image is.
"""

import logging

import numpy as np
from scipy import ndimage

from addvc.geometry.threshold import far_void, robust_deviation

log = logging.getLogger(__name__)

SHARP, BLURRED = 0.8, 0.7
"""Of the threshold for the porosity, above the void, in the image as scanned and in the blurred one:
where no strut is lost yet and none is made up. Blur lowers the grey level of thin struts."""

CLEAR = 4.0
"""Deviations of the noise that the lower threshold must be above the void: then less than one voxel of
the void in 30,000 is taken for solid."""


def solid_mask(
    excess: np.ndarray, blurred: np.ndarray, limit: float, inside: np.ndarray
) -> np.ndarray:
    """The largest component (nx, ny, nz) of the solid `inside`; grey levels above that of the void:
    excess as scanned, blurred as the threshold for the porosity is of, which is `limit` above it."""
    noise = void_deviation(excess, inside & far_void(blurred, limit))
    sharp = SHARP * limit >= CLEAR * noise
    log.info(
        "the threshold is %.1f deviations of the noise as scanned above the void (at least %.1f): "
        "struts are those of the %s image",
        SHARP * limit / max(noise, 1e-12), CLEAR, "scanned" if sharp else "blurred",
    )  # fmt: skip
    return largest(inside & (excess > SHARP * limit if sharp else blurred > BLURRED * limit))


def void_deviation(excess: np.ndarray, void: np.ndarray) -> float:
    """Standard deviation of the grey level in the void, bool (nx, ny, nz), from its median; infinite
    where there is no void to tell it."""
    return robust_deviation(excess[void]) if void.any() else np.inf


def largest(mask: np.ndarray) -> np.ndarray:
    """The largest component (nx, ny, nz), of 26 neighbours."""
    label, _ = ndimage.label(mask, np.ones((3, 3, 3)))
    count = np.bincount(label.ravel(), minlength=2)
    count[0] = 0
    return (label == count.argmax()) & mask
