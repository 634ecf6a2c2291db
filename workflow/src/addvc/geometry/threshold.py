"""The grey level gamma at which the segmented solid has the porosity of the supplier (bisection).

The porosity is the share of voxel centres of the specimen (between the platens, inside its
outline) whose blurred grey level is below gamma. The marching-cubes volume is some 10 % smaller
than that of the voxels for struts two voxels thick: the count of voxels is what is matched.
"""

import logging
from dataclasses import replace

import numpy as np
from scipy import ndimage

from addvc.errors import GeometryError, grey_words
from addvc.images.specimen import Specimen
from addvc.images.spline import DEGREE, spline_value

log = logging.getLogger(__name__)

SEED = 2417
MOST = 1_000_000
"""Voxels of the void that its noise is read from; of more, some are left out."""

FLAT = 0.002
"""Noise over the contrast of solid and void, at least; that of a good scan is some hundredths."""


def bisect_threshold(
    grey: np.ndarray, porosity: float, tolerance: float = 1e-4, max_iterations: int = 60
) -> tuple[float, list[tuple[float, float]]]:
    """gamma for grey levels (n,) of the specimen, and the (gamma, porosity) of each iteration.

    Raises GeometryError when the nearest porosity that a threshold gives is off by over
    `tolerance` and over a twentieth of the solid fraction."""
    if not 0 < porosity < 1:
        raise GeometryError(f"porosity is {porosity}; it must be between 0 and 1 (both excluded)")
    low, high, trials = float(grey.min()), float(grey.max()), []
    for _ in range(max_iterations):
        gamma = (low + high) / 2
        trials.append((gamma, float(np.mean(grey < gamma))))
        if abs(trials[-1][1] - porosity) < tolerance:
            break
        low, high = (gamma, high) if trials[-1][1] < porosity else (low, gamma)
    best = min(trials, key=lambda trial: abs(trial[1] - porosity))
    if abs(best[1] - porosity) > max(tolerance, 0.05 * (1 - porosity)):
        raise GeometryError(
            f"no threshold gives a porosity of {porosity}: the nearest is {best[1]:.4f} at grey "
            f"level {grey_words(best[0])}; check porosity, or the bit depth of the scan"
        )
    return best[0], trials


def check_contrast(grey: np.ndarray, gamma: float) -> dict:
    """Medians of void and solid and the noise of the void, of grey levels (n,), in grey levels.

    The noise is 1.48 times the median absolute deviation of what is below gamma. Raises GeometryError
    where gamma leaves no void or no solid, or is less than twice the noise above the void."""
    void, solid = grey[grey < gamma], grey[grey >= gamma]
    if len(void) == 0 or len(solid) == 0:
        raise GeometryError(
            f"the threshold {grey_words(gamma)} leaves no {'solid' if len(void) else 'void'}: "
            f"grey levels of the specimen go from {grey_words(grey.min())} to "
            f"{grey_words(grey.max())}; change geometry.threshold"
        )
    level = float(np.median(void))
    noise = robust_deviation(void)
    if gamma < level + 2 * noise:
        raise GeometryError(
            f"the threshold {grey_words(gamma)} is within 2 standard deviations of the void "
            f"({grey_words(level)}, noise {grey_words(noise)}): it makes "
            f"{np.mean(grey >= gamma):.0%} of the specimen solid, void included; raise porosity, or "
            "give geometry.threshold; if struts are darker than the void, invert the scans; if the "
            "platens were taken for the specimen, correct "
            "loading_axis or scans.axes"
        )
    return {"void": level, "solid": float(np.median(solid)), "noise": noise}


def specimen_mask(
    shape: tuple[int, int, int], specimen: Specimen, margin: float = 3.0
) -> np.ndarray:
    """Voxels (nx, ny, nz) of the specimen, `margin` off the platens (their blurred faces)."""
    inner = replace(specimen, low=specimen.low + margin, high=specimen.high - margin)
    return inner.voxel_mask(shape)


def void_noise(
    smooth: np.ndarray, mask: np.ndarray, gamma: float, degree: int = DEGREE
) -> tuple[float, float] | None:
    """Noise of the void far from any solid, whose blurred halo is no noise: of its voxels, and of the
    spline of this degree at random places in them, which smooths it.

    None where less than 1 % of the mask (nx, ny, nz) is that far."""
    void = mask & far_void(smooth, gamma)
    if void.sum() < 0.01 * mask.sum():
        return None
    centres = some_centres(void, MOST)
    places = centres + np.random.default_rng(SEED).uniform(-0.5, 0.5, centres.shape)
    value, inside = spline_value(smooth, places, degree)
    return robust_deviation(smooth[void]), robust_deviation(value[inside])


def some_centres(chosen: np.ndarray, most: int) -> np.ndarray:
    """Centres (q, 3) of the voxels that are chosen (nx, ny, nz), at most `most`, evenly thinned out."""
    index = np.flatnonzero(chosen)
    step = max(1, -(-len(index) // most))
    return np.stack(np.unravel_index(index[::step], chosen.shape), axis=1)


def robust_deviation(x: np.ndarray) -> float:
    """Standard deviation of what is normal but for outliers (n,): 1.48 times the median absolute one."""
    return 1.4826 * float(np.median(np.abs(x - np.median(x))))


def far_void(smooth: np.ndarray, gamma: float, away: int = 3) -> np.ndarray:
    """Voxels (nx, ny, nz) at least `away` voxels from any solid, bool."""
    return ~ndimage.binary_dilation(smooth >= gamma, iterations=away)


def find_threshold(
    smooth: np.ndarray,
    specimen: Specimen,
    porosity: float,
    setting: str | float,
    degree: int = DEGREE,
) -> dict:
    """gamma ("auto": by bisection; a number: given) of spline coefficients (nx, ny, nz), what it gives,
    and the levels around it. Raises GeometryError where the specimen holds no voxel."""
    mask = specimen_mask(smooth.shape, specimen)
    grey = smooth[mask]
    if len(grey) == 0:
        raise GeometryError(f"the specimen holds no voxel ({specimen}); check scans.platens")
    gamma, trials = bisect_threshold(grey, porosity) if setting == "auto" else (setting, [])
    levels = check_contrast(grey, gamma)
    return levels | {
        "threshold": float(gamma),
        "porosity": float(np.mean(grey < gamma)),
        "target": porosity,
        "trials": trials,
        **noise_of(levels, void_noise(smooth, mask, gamma, degree)),
    }


def noise_of(levels: dict, far: tuple[float, float] | None) -> dict:
    """`noise` of the voxels and `noise_at_points` of the spline between them (grey levels), and where
    they are from: `far`, of the void far from any solid, or all void where that is None. Of a flat void
    FLAT of the contrast: no residual is below nothing."""
    noise, origin = (levels["noise"], levels["noise"]), "all void"
    if far is not None:
        noise, origin = far, "void 3 voxels off the solid"
    least = FLAT * (levels["solid"] - levels["void"])
    if noise[0] < least:
        log.warning(
            "WARNING: the void is flat (noise %.2g grey levels): was the scan denoised or segmented? "
            "%.1f %% of the contrast, %.2g, is taken for its noise; give the scans as they were "
            "reconstructed",
            noise[0],
            100 * FLAT,
            least,
        )
        noise, origin = (least, least), f"{FLAT:.1%} of the contrast: the void is flat"
    return {"noise": noise[0], "noise_at_points": noise[1], "noise_from": origin}
