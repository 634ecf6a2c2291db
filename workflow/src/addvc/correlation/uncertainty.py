"""What the noise of the images does to a displacement, known before any deformed image is.

Linearised about rest, without robust weights, u = A^-1 b with b the right-hand side of the noise
alone, that of both images. Where the noise is white at the points of the quadrature,
cov(b) = 2 sigma^2 H and

    cov(u) = 2 sigma^2 A^-1 H A^-1        (Leclerc, Perie, Roux, Hild: Exp. Mech. 52, 2012)

The pre-filter and the spline correlate the noise of neighbouring points, and weigh more than sigma
says where elements are larger than a voxel. So b is drawn from noise fields, and diag cov(u) is the
mean of u^2: exact in the mean, to 1 / sqrt(2 n draws) of its rms over n unknowns.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from addvc.correlation.metric import right_hand_side
from addvc.correlation.register import System
from addvc.images.spline import gaussian_blur, spline_value

DRAWS = 8
SEED = 2417


@dataclass(frozen=True)
class Noise:
    """Of one image after the pre-filter of Eq. 8: standard deviation (grey levels), `blur` (voxels)."""

    std: float
    blur: float

    def volume(self, shape: tuple[int, int, int], rng: np.random.Generator) -> np.ndarray:
        """White noise (nx, ny, nz) that the pre-filter has blurred, as spline coefficients."""
        field = gaussian_blur(rng.standard_normal(shape, dtype=np.float32), self.blur)
        return field * np.float32(self.std / field.std())


def of_noise(system: System, at_points: Callable[[], np.ndarray], draws: int) -> np.ndarray:
    """Standard uncertainty (n, 3) of each nodal displacement (voxels) when the residual is what
    at_points() draws (Q,) (grey levels)."""
    square = np.zeros_like(system.reference.mesh.points)
    for u in drawn(system, at_points, draws):
        square += u**2 / draws
    return np.sqrt(square)


def drawn(system: System, at_points: Callable[[], np.ndarray], draws: int) -> Iterator[np.ndarray]:
    """Displacements (n, 3), voxels, that residuals make which at_points() draws (Q,)."""
    reference = system.reference
    for _ in range(draws):
        r = np.where(reference.inside, at_points(), 0)
        yield system.factor.solve(right_hand_side(reference, r)).reshape(-1, 3)


def of_two_images(
    system: System, shape: tuple[int, int, int], noise: Noise
) -> Callable[[], np.ndarray]:
    """Draws of the residual (Q,) that the noise of two images of `shape` makes (grey levels)."""
    rng, at = np.random.default_rng(SEED), system.reference
    points, degree = at.quadrature.points, at.degree
    return lambda: np.sqrt(2) * spline_value(noise.volume(shape, rng), points, degree)[0]


def fields_of_noise(
    system: System, shape: tuple[int, int, int], noise: Noise, draws: int = 2 * DRAWS
) -> np.ndarray:
    """Displacements (d, n, 3), float32 voxels, by the noise of two images of `shape`: they hold what
    the uncertainty of a node does not, how the errors of neighbours go together."""
    at_points = of_two_images(system, shape, noise)
    return np.stack([u.astype(np.float32) for u in drawn(system, at_points, draws)])


def a_priori(
    system: System, shape: tuple[int, int, int], noise: Noise, draws: int = DRAWS
) -> np.ndarray:
    """Standard uncertainty (n, 3), voxels, from the noise of two images of `shape`."""
    return of_noise(system, of_two_images(system, shape, noise), draws)


def a_priori_white(system: System, sigma: float, draws: int = DRAWS) -> np.ndarray:
    """The root of diag(2 sigma^2 A^-1 H A^-1) (n, 3), voxels: noise `sigma` without correlation.

    A point of weight w (voxels) counts as w voxels, each with noise of its own."""
    rng, weight = np.random.default_rng(SEED), system.reference.quadrature.weight
    scale = sigma * np.sqrt(2 / weight)
    return of_noise(system, lambda: scale * rng.standard_normal(len(weight)), draws)
