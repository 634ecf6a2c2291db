"""Levels: every change of level keeps the voxel centres where they are."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from addvc.images.levels import (
    bin_mean,
    displacement_to_coarse,
    displacement_to_fine,
    pyramid,
    to_coarse,
    to_fine,
)


def centres(shape):
    """Positions (n, 3) of all voxel centres."""
    return np.indices(shape).reshape(3, -1).T.astype(float)


@pytest.mark.parametrize("factor", [1, 2, 3, 5])
def test_positions_go_there_and_back(factor):
    x = np.random.default_rng(2417).normal(size=(50, 3)) * 40
    assert_allclose(to_coarse(to_fine(x, factor), factor), x, atol=1e-12)
    assert_allclose(displacement_to_coarse(displacement_to_fine(x, factor), factor), x, atol=1e-12)


def test_displacement_is_a_difference_of_positions():
    x, u = np.array([[3.0, 4.0, 5.0]]), np.array([[0.5, -1.0, 2.0]])
    assert_allclose(displacement_to_fine(u, 3), to_fine(x + u, 3) - to_fine(x, 3))


@pytest.mark.parametrize("factor", [2, 3, 4])
def test_affine_grey_keeps_its_value_at_mapped_positions(factor):
    slope, shape = np.array([1.5, -0.25, 0.75]), (12, 24, 13)
    fine = (centres(shape) @ slope + 7).reshape(shape)
    coarse = bin_mean(fine, factor)
    expected = to_fine(centres(coarse.shape), factor) @ slope + 7
    assert_allclose(coarse.ravel(), expected, atol=1e-5)


@pytest.mark.parametrize("factor", [2, 3])
def test_centroid_of_a_blob_moves_without_bias(factor):
    shape, centre = (36, 42, 30), np.array([17.3, 20.9, 14.2])
    blob = np.exp(-((centres(shape) - centre) ** 2).sum(axis=1) / (2 * 2.5**2)).reshape(shape)
    coarse = bin_mean(blob, factor)
    centroid = coarse.ravel() @ centres(coarse.shape) / coarse.sum()
    assert_allclose(centroid, to_coarse(centre, factor), atol=1e-4)


def test_bin_mean_is_the_mean_of_blocks_and_cuts_the_remainder():
    volume = np.random.default_rng(2417).integers(0, 65536, (7, 9, 11), dtype=np.uint16)
    blocks = volume[:6, :9, :9].reshape(2, 3, 3, 3, 3, 3).mean(axis=(1, 3, 5))
    binned = bin_mean(volume, 3)
    assert binned.dtype == np.float32
    assert_allclose(binned, blocks, rtol=1e-6)
    assert_array_equal(bin_mean(volume, 1), volume)


def test_bin_mean_leaves_its_input_alone():
    volume = np.ones((4, 4, 4), np.float32)
    bin_mean(volume, 1)[:] = 3
    assert_array_equal(volume, 1)


@pytest.mark.parametrize("factor", [0, 1.5, -2])
def test_bin_mean_refuses_a_factor_that_is_no_whole_number(factor):
    with pytest.raises(ValueError, match=f"binning factor is {factor}; use a whole number"):
        bin_mean(np.zeros((4, 4, 4)), factor)


def test_bin_mean_refuses_a_factor_beyond_the_size():
    with pytest.raises(ValueError, match="cannot be binned by 5; use a factor of at most 4"):
        bin_mean(np.zeros((8, 4, 8)), 5)


def test_pyramid_starts_with_the_finest():
    volume = np.random.default_rng(2417).random((16, 24, 20))
    images = pyramid(volume, 3)
    assert [image.shape for image in images] == [(16, 24, 20), (8, 12, 10), (4, 6, 5)]
    assert_allclose(images[2], bin_mean(volume, 4), rtol=1e-5)
    with pytest.raises(ValueError, match="0 levels"):
        pyramid(volume, 0)
