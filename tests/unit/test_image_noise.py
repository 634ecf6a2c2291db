"""The residual that noise alone leaves is that which a perfect registration has."""

import numpy as np
import pytest

from addvc.analysis.image_noise import pair_noise
from addvc.images.specimen import Specimen
from addvc.images.spline import gaussian_blur, spline_value

SHAPE, SHIFT, GAMMA = (60, 64, 60), np.array([1.3, -0.6, 0.45]), 60.0
SPECIMEN = Specimen("box", 1, -0.5, 63.5, (29.5, 29.5), bounds=((-0.5, 59.5), (-0.5, 59.5)))


def bars(shift, noise, seed, thick=3.0):
    """Blurred image of bars along y, a cell of 20 voxels wide, shifted, with white noise."""
    x, _, z = np.indices(SHAPE).astype(float)
    near = [
        np.abs((axis - move) % 20 - 10) for axis, move in zip((x, z), shift[[0, 2]], strict=True)
    ]
    solid = np.clip(thick + 0.5 - np.hypot(*near), 0, 1)
    rng = np.random.default_rng(seed)
    image = 20 + 100 * solid + noise * rng.standard_normal(SHAPE)
    return gaussian_blur(image.astype(np.float32), 0.7)


@pytest.mark.parametrize("noise", [2.0, 6.0])
def test_it_is_the_residual_under_the_true_displacement(noise):
    images = bars(np.zeros(3), noise, 2417), bars(SHIFT, noise, 731)
    still = bars(np.zeros(3), 0.0, 1), bars(SHIFT, 0.0, 1)
    points = np.random.default_rng(5).uniform(6, 53, (60_000, 3))
    r = {}
    for name, (one, other) in (("noisy", images), ("still", still)):
        r[name] = spline_value(one, points)[0] - spline_value(other, points + SHIFT)[0]
    inside = spline_value(still[0], points)[0] > GAMMA
    expected = (r["noisy"] - r["still"])[inside].std()
    assert pair_noise(*images, SPECIMEN, GAMMA) == pytest.approx(expected, rel=0.05)


def test_noise_of_both_images_adds_up():
    quiet, loud = bars(SHIFT, 2.0, 2417), bars(SHIFT, 6.0, 731)
    both = pair_noise(quiet, loud, SPECIMEN, GAMMA)
    least = pair_noise(quiet, bars(SHIFT, 2.0, 77), SPECIMEN, GAMMA)
    assert both / least == pytest.approx(np.sqrt((4 + 36) / 8), rel=0.03)


def test_without_void_far_from_solid_it_is_not_known():
    image = bars(np.zeros(3), 2.0, 2417, thick=12.0)
    assert pair_noise(image, image, SPECIMEN, GAMMA) is None
