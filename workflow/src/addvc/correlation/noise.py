"""What the noise of the images does to a displacement, as draws.

Linearised about the solution, u = A^-1 b where b is the right-hand side (Eq. 3) of the noise alone, that
of both images (Leclerc, Perie, Roux, Hild: Exp. Mech. 52, 2012). Draws hold what a variance a node
does not: how the errors of neighbours go together.
"""

from collections.abc import Callable

import numpy as np

from addvc.correlation.metric import Reference, right_hand_side
from addvc.images.spline import gaussian_blur, spline_value

DRAWS = 16
SEED = 2417


def noise_volume(
    shape: tuple[int, int, int], std: float, blur: float, rng: np.random.Generator
) -> np.ndarray:
    """Noise (nx, ny, nz) of a deviation `std` (grey levels) that the pre-filter of Eq. 8 has blurred
    (`blur` in voxels), as spline coefficients."""
    field = gaussian_blur(rng.standard_normal(shape, dtype=np.float32), blur)
    return field * np.float32(std / field.std())


def noise_draws(
    reference: Reference,
    solve: Callable[[np.ndarray], np.ndarray],
    noise: Callable[[np.random.Generator], np.ndarray],
    draws: int = DRAWS,
) -> np.ndarray:
    """Displacements (d, n, 3) in voxels, float32, by the noise of two images; solve(b): A^-1 b,
    noise(rng): spline coefficients of the noise of one image."""
    rng = np.random.default_rng(SEED)
    found = np.empty((draws, *reference.mesh.points.shape), dtype=np.float32)
    for draw in found:
        grey, _ = spline_value(noise(rng), reference.quadrature.points)
        r = np.where(reference.inside, np.sqrt(2) * grey, 0)
        draw[:] = solve(right_hand_side(reference, r)).reshape(draw.shape)
    return found
