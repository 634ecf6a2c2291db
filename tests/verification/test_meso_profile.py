"""The residual of meso DVC along the loading axis is where its displacement is wrong."""

import numpy as np
import pytest

from addvc.correlation.meso_profile import squared_residual
from addvc.images.spline import DEGREE


def test_a_wrong_displacement_shows_where_it_is(speckle, box):
    """The same image twice: right at rest, wrong about the middle of y, which the planes tell."""
    image, mesh = speckle((32, 48, 32)), box((2, 2, 2), (29, 45, 29), (5, 8, 5))
    wrong = np.exp(-(((mesh.points[:, [1]] - 30.0) / 4) ** 2)) * [0.0, 0.0, 1.0]
    gamma = float(np.median(image))
    square, count = squared_residual(
        mesh, image, [(image, 0 * wrong), (image, wrong)], gamma, 1, DEGREE
    )
    assert len(square) == len(count) == 48 and count[0] == count[47] == 0
    mean = square / np.maximum(count, 1)
    assert abs(int(np.argmax(mean)) - 30) <= 2
    assert mean[4:15].max() < 0.05 * mean.max()
    rest, _ = squared_residual(mesh, image, [(image, 0 * wrong)], gamma, 1, DEGREE)
    assert rest == pytest.approx(0, abs=1e-6 * square.max())
