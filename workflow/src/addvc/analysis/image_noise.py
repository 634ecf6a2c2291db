"""What the residual would be under the true displacement: the noise of both images, met in the void.

Void far from any solid looks the same wherever it goes, so that the difference of two images there is
the residual of a perfect registration, as far as noise makes it. Artefacts that stay with the scanner
are in it as they are in the residual; partial volumes of struts that turn are not.
"""

import numpy as np

from addvc.geometry.threshold import far_void, robust_deviation, some_centres, specimen_mask
from addvc.images.specimen import Specimen
from addvc.images.spline import DEGREE, spline_value

SEED = 2417
LEAST = 0.01
"""Share of the specimen that must be void in both images."""

MOST = 2_000_000
"""Voxels; more are thinned out."""


def pair_noise(
    reference: np.ndarray,
    deformed: np.ndarray,
    specimen: Specimen,
    gamma: float,
    degree: int = DEGREE,
) -> float | None:
    """Standard deviation of I_r(x) - I_d(x + u), grey levels, that noise alone leaves; None where too
    little of the specimen is void in both blurred images (nx, ny, nz).

    The splines of Eq. 4 are taken at random places within the voxels, each of its own, as those of
    the quadrature are; 1.48 times the median absolute deviation."""
    mask = specimen_mask(reference.shape, specimen)
    void = mask & far_void(reference, gamma) & far_void(deformed, gamma)
    if void.sum() < LEAST * mask.sum() or not void.any():
        return None
    centres, rng = some_centres(void, MOST), np.random.default_rng(SEED)
    here, there = (
        spline_value(image, centres + rng.uniform(-0.5, 0.5, centres.shape), degree)
        for image in (reference, deformed)
    )
    r = (here[0] - there[0])[here[1] & there[1]]
    return robust_deviation(r)
