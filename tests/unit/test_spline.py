"""The grey level between voxels: what the B-splines of Eq. 4 must keep, and their derivative."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.interpolate import BSpline

from addvc.images.spline import (
    gaussian_blur,
    gradient_length,
    interpolating_coefficients,
    spline_value,
    spline_value_gradient,
)

SHAPE = (14, 15, 16)


def voxels(shape=SHAPE):
    """Voxel centres (n, 3)."""
    return np.indices(shape).reshape(3, -1).T.astype(float)


def points(count=400, margin=0.0):
    """Random points at least `margin` voxels off the outermost voxel centres."""
    return np.random.default_rng(2417).uniform(margin, np.array(SHAPE) - 1 - margin, (count, 3))


@pytest.fixture
def noise():
    return np.random.default_rng(6113).standard_normal(SHAPE).astype(np.float32)


@pytest.fixture(params=[3, 5])
def degree(request):
    return request.param


def test_constant_is_kept_up_to_the_border(degree):
    grey = np.full(SHAPE, 7.0, np.float32)
    value, gradient, inside = spline_value_gradient(grey, points(), degree)
    assert inside.all()
    assert_allclose(value, 7, rtol=1e-6)
    assert_allclose(gradient, 0, atol=1e-5)


def test_affine_grey_is_kept_off_the_border(degree):
    slope = np.array([1.5, -0.25, 0.75])
    volume = (voxels() @ slope + 3).reshape(SHAPE).astype(np.float32)
    x = points(margin=2)
    value, gradient, _ = spline_value_gradient(volume, x, degree)
    assert_allclose(value, x @ slope + 3, atol=1e-5)
    assert_allclose(gradient, np.broadcast_to(slope, x.shape), atol=1e-5)


def test_voxels_as_coefficients_smooth_by_the_variance_of_the_spline(degree):
    """Eq. 4 without prefilter: sum_k k^2 B_p(x - k) = x^2 + (p + 1) / 12."""
    volume = (voxels()[:, 1] ** 2).reshape(SHAPE).astype(np.float32)
    x = points(margin=2)
    expected = x[:, 1] ** 2 + (degree + 1) / 12
    assert_allclose(spline_value(volume, x, degree)[0], expected, atol=1e-4)


def test_an_impulse_shows_the_basis_spline(degree):
    """Against scipy's, in each direction."""
    impulse = np.zeros((13, 13, 13), np.float32)
    impulse[6, 6, 6] = 1
    basis = BSpline.basis_element(np.arange(degree + 2) - (degree + 1) / 2, extrapolate=False)
    t = np.linspace(-3.4, 3.4, 69)
    expected = np.nan_to_num(basis(t)) * basis(0) ** 2
    for axis in np.eye(3):
        found = spline_value(impulse, 6 + t[:, None] * axis, degree)[0]
        assert_allclose(found, expected, atol=1e-6)


@pytest.mark.parametrize("kernel", [spline_value, spline_value_gradient])
def test_other_degrees_are_refused(noise, kernel):
    with pytest.raises(ValueError, match=r"must be 3 or 5: set images\.degree"):
        kernel(noise, points(), 4)


def test_a_higher_degree_sees_less_of_where_the_voxels_are():
    """A wave of 4 voxels that is moved by less than a voxel, and the points with it."""
    x, shifts = points(2000, margin=3), np.arange(8) / 8

    def change(degree):
        waves = [np.sin(np.pi / 2 * (voxels()[:, 0] - s)).reshape(SHAPE) for s in shifts]
        values = [
            spline_value(wave.astype(np.float32), x + np.array([s, 0, 0]), degree)[0]
            for wave, s in zip(waves, shifts, strict=True)
        ]
        return np.std(values, axis=0).mean() / np.std(values[0])

    assert change(5) < change(3) / 3


def test_interpolating_coefficients_pass_through_the_voxels(noise, degree):
    inner = voxels()[np.all((voxels() >= 2) & (voxels() <= np.array(SHAPE) - 3), axis=1)]
    value, _ = spline_value(interpolating_coefficients(noise, degree), inner, degree)
    assert_allclose(value, noise[tuple(inner.astype(int).T)], atol=1e-5)


def test_gradient_is_the_derivative_of_the_value(noise, degree):
    """|I(x + t h) - I(x) - t g.h| falls with slope 2."""
    x = points(margin=2)
    way = np.random.default_rng(6113).uniform(-1, 1, x.shape)
    value, gradient, _ = spline_value_gradient(noise, x, degree)
    steps, errors = np.array([0.2, 0.1, 0.05]), []
    for t in steps:
        ahead = spline_value(noise, x + t * way, degree)[0].astype(float)
        errors.append(np.abs(ahead - value - t * np.sum(gradient * way, axis=1)).mean())
    assert_allclose(np.diff(np.log(errors)) / np.diff(np.log(steps)), 2, atol=0.1)


def test_both_kernels_give_the_same_value(noise, degree):
    value = spline_value(noise, points(), degree)[0]
    assert_array_equal(value, spline_value_gradient(noise, points(), degree)[0])


def test_outside_begins_beyond_the_outermost_voxel_centres(noise):
    last = np.array(SHAPE) - 1.0
    beyond = last * [1, 1 + 1e-9, 1]
    x = np.array([[0, 0, 0], last, [-1e-9, 5, 5], beyond, [np.nan, 5, 5]])
    value, gradient, inside = spline_value_gradient(noise, x)
    assert_array_equal(inside, [True, True, False, False, False])
    assert_array_equal(spline_value(noise, x)[1], inside)
    assert_array_equal(value[~inside], 0)
    assert_array_equal(gradient[~inside], 0)


def test_blur_of_an_impulse_has_its_variance_and_keeps_its_sum():
    volume = np.zeros((31, 31, 31), np.float32)
    volume[15, 15, 15] = 1
    blurred = gaussian_blur(volume, 0.8)
    assert blurred.sum() == pytest.approx(1, abs=1e-5)
    spread = (voxels(volume.shape) - 15) ** 2
    assert_allclose(blurred.ravel() @ spread, 0.8**2, rtol=0.01)
    assert_array_equal(gaussian_blur(volume, 0), volume)


def test_number_of_threads_changes_nothing(noise, with_one_and_two_threads):
    results = with_one_and_two_threads(lambda: spline_value_gradient(noise, points(5000)))
    for one, two in zip(*results, strict=True):
        assert_array_equal(one, two)


def test_gradient_at_all_voxel_centres_is_that_at_each(rng, degree):
    image = rng.normal(50, 20, (9, 12, 10)).astype(np.float32)
    centres = np.argwhere(np.ones(image.shape, bool)).astype(float)
    gradient = spline_value_gradient(image, centres, degree)[1]
    length = np.linalg.norm(gradient, axis=1).reshape(image.shape)
    assert_allclose(gradient_length(image, degree), length, rtol=1e-4, atol=1e-4)
