"""Free-form DVC finds what is known: derivatives, rest, shifts, strains, smooth fields."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from addvc.correlation import freeform as module
from addvc.correlation.clear import clear_points
from addvc.correlation.freeform import (
    LEVELS,
    FreeformOptions,
    affine_start,
    freeform,
    freeform_options,
)
from addvc.correlation.gauss_newton import rms
from addvc.correlation.spline_grid import evaluate, grid_over
from addvc.correlation.spline_metric import (
    hessian,
    linearise,
    right_hand_side,
    sample,
)
from addvc.correlation.spline_stencil import stencil_product
from addvc.correlation.ultimate import fft_shift
from addvc.errors import CorrelationError
from addvc.images.spline import interpolating_coefficients
from addvc.twin.virtual import VirtualField, warp

AXIS = 1
OPTIONS = FreeformOptions(AXIS)


def inner(shape, margin, step=2.0):
    """Points of an image, clear of its faces."""
    lines = [np.arange(margin, n - margin, step) for n in shape]
    return np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 3)


def error(found, points, truth):
    """rms length of the error vector, voxels."""
    grid, solution, _ = found
    return rms(evaluate(grid, solution.u, points) - truth)


@pytest.fixture(scope="module")
def image(speckle):
    return interpolating_coefficients(speckle((48, 52, 50)))


# --------------------------------------------------------------------------- derivatives


@pytest.fixture
def small(image):
    """I_r sampled on a grid of 8 voxels, well inside of the image."""
    return well_inside(sample(grid_over(image.shape, 8.0), image, 1, 8.0))


def well_inside(sampling):
    """The same with weight only where no edge of the image (48, 52, 50) is near."""
    keep = ((sampling.points.points > 6) & (sampling.points.points < 41)).all(axis=1)
    return replace(sampling, weight=np.where(keep, 1.0, 0.0))


def smooth_coefficients(grid):
    x = grid.control_points() / 15
    return np.stack([np.sin(x[..., 1]), np.cos(x[..., 2] + 1), np.sin(x[..., 0])], axis=-1)


def observed_order(steps, errors):
    return (np.diff(np.log(errors)) / np.diff(np.log(steps)))[-1]


@pytest.mark.parametrize("shift", [(0, 0, 0), (2, -1, 3)])
def test_right_hand_side_is_the_gradient_of_the_functional(small, image, shift):
    """|S(u + t v) - S(u) + 2 t b.v| falls with slope 2 where grad I_r(x) = grad I_d(x + u)."""
    deformed = np.roll(image, shift, axis=(0, 1, 2)) + np.float32(15)
    u = np.zeros_like(small.points.points) + shift
    direction = smooth_coefficients(small.grid)
    v = small.displacement(direction)

    def functional(field):
        return small.weight @ linearise(small, deformed, field)[0] ** 2

    r, slope, _ = linearise(small, deformed, u)
    b = np.sum(right_hand_side(small, r, slope) * direction)
    steps = np.array([0.2, 0.1, 0.05, 0.025])
    errors = [abs(functional(u + t * v) - functional(u) + 2 * t * b) for t in steps]
    assert observed_order(steps, errors) == pytest.approx(2, abs=0.1)
    assert abs(b) > 0


def test_hessian_is_the_curvature_of_the_functional_at_the_solution(small, image):
    """S(t v) -> t^2 v^T H v where the images agree."""
    direction = smooth_coefficients(small.grid)
    u = small.displacement(direction)
    h = hessian(small, linearise(small, image, np.zeros_like(u))[1])
    curvature = np.sum(direction * stencil_product(h, direction))
    r, _, _ = linearise(small, image, 0.01 * u)
    assert small.weight @ r**2 == pytest.approx(0.01**2 * curvature, rel=0.01)


def test_mean_gradient_predicts_a_motion_one_order_better(speckle):
    """r - g . d falls with slope 3 in the motion d for the mean gradient, 2 for that of I_r."""
    volume = speckle((48, 52, 50), length=10.0)
    small = well_inside(sample(grid_over(volume.shape, 8.0), volume, 1, 8.0))
    steps, way = np.array([1.6, 0.8, 0.4]), np.array([0.5, -0.6, 0.62])
    mean, plain = [], []
    for t in steps:
        still = np.zeros_like(small.points.points)
        r, slope, _ = linearise(small, fft_shift(volume, t * way), still)
        mean.append(small.weight @ np.abs(r - slope @ (t * way)))
        plain.append(small.weight @ np.abs(r - small.gradient @ (t * way)))
    assert observed_order(steps, mean) == pytest.approx(3, abs=0.2)
    assert observed_order(steps, plain) == pytest.approx(2, abs=0.2)


# ------------------------------------------------------------------------- known motions


def test_rest_gives_exactly_zero(image):
    _, solution, table = freeform(image, image, OPTIONS)
    assert_array_equal(solution.u, 0)
    assert solution.converged
    assert solution.history == [0.0] * len(LEVELS)
    assert solution.residual == {"mean": 0.0, "std": 0.0, "outside": 0}
    assert [row["spacing"] for row in table] == [level.spacing for level in LEVELS]


def test_a_shift_is_found(speckle):
    shift = np.array([0.31, -0.42, 0.57])
    volume = speckle((48, 52, 50))
    found = freeform(volume, fft_shift(volume, shift), OPTIONS)
    left = error(found, inner(volume.shape, 8), shift)
    print(f"rms {left:.1e} voxel")
    assert left < 0.01


def test_a_smooth_field_is_found(speckle):
    """A compression of 4 % with waves of up to a voxel, as in a virtual test."""
    volume = speckle((64, 72, 60))
    field = VirtualField((0.04,), AXIS, amplitude=0.4, wavelength=60.0)
    deformed = warp(volume, field, 1, 1, 0.0, 2417)
    images = [interpolating_coefficients(v) for v in (volume, deformed)]
    points = inner(volume.shape, 10)
    truth = field.displacement(points, 1)
    left = error(freeform(*images, OPTIONS), points, truth)
    print(f"rms {left:.3f} voxel of {rms(truth):.2f}")
    assert left < 0.02


def test_of_a_large_image_not_every_voxel_takes_part(speckle, monkeypatch):
    volume, shift = speckle((64, 72, 60)), (0.3, -0.4, 0.6)
    monkeypatch.setattr(module, "MOST", volume.size / 8)
    grid, solution, table = freeform(volume, fft_shift(volume, shift), OPTIONS)
    assert table[-1]["points"] < 0.2 * volume.size
    assert error((grid, solution, table), inner(volume.shape, 8), shift) < 0.02


def test_threads_change_nothing(speckle, with_one_and_two_threads):
    volume = speckle((30, 32, 28))
    deformed = fft_shift(volume, (0.3, -0.4, 0.6))
    one, two = with_one_and_two_threads(lambda: freeform(volume, deformed, OPTIONS)[1])
    assert_array_equal(one.u, two.u)
    assert one.history == two.history


def test_platens_give_the_compression_to_begin_with(rng):
    """Faces at 9.5 and 49.5, then at 9.5 and 41.5: between them an affine field, rigid beyond."""
    images = []
    for top in (50, 42):
        volume = rng.normal(20, 2, (40, 60, 40)).astype(np.float32)
        volume[:, :10], volume[:, top:] = 150, 150
        images.append(volume)
    grid = grid_over(images[0].shape, 8.0)
    u = affine_start(grid, *images, AXIS)
    y = grid.control_points()[..., 1]
    assert_allclose(u[..., 1], np.interp(y, [9.5, 49.5], [0, -8]), atol=0.1)
    assert_array_equal(u[..., [0, 2]], 0)


def test_a_spacing_that_asks_for_too_much_memory_stays_twice_as_large(image, monkeypatch):
    monkeypatch.setattr(module, "ALWAYS", 500)
    grid, solution, table = freeform(image, image, OPTIONS)
    assert [row["spacing"] for row in table] == [32.0, 16.0, 16.0, 16.0, 16.0]
    assert np.prod(grid.shape) <= 1000 and grid.spacing == 16
    assert_allclose(solution.u, 0, atol=1e-6)


def test_a_platen_that_one_image_alone_shows_has_not_moved(rng):
    """It comes into the field of view: the end of the reference is no face."""
    images = [rng.normal(20, 2, (40, 60, 40)).astype(np.float32) for _ in range(2)]
    for volume in images:
        volume[:, :10] = 150
    images[1][:, 52:] = 150
    assert not affine_start(grid_over(images[0].shape, 8.0), *images, AXIS).any()


def test_without_platens_it_begins_at_rest(image):
    assert not affine_start(grid_over(image.shape, 8.0), image, image, AXIS).any()


# ------------------------------------------------------------------------ which voxels


def test_noise_in_the_void_takes_no_part(rng):
    """A bright rod in noise: its surface is taken, few voxels of the void are."""
    volume = rng.normal(20, 2, (48, 48, 48)).astype(np.float32)
    x, y, _ = np.indices(volume.shape)
    away = np.hypot(x - 23.5, y - 23.5)
    volume[away < 9] += 100
    found = clear_points(volume, 1, 6.0)
    distance = np.hypot(found[:, 0] - 23.5, found[:, 1] - 23.5)
    assert (abs(distance - 9) < 3).mean() > 0.99
    assert len(found) > 0.5 * 48 * 2 * np.pi * 9 * 2


def test_where_all_is_texture_most_voxels_take_part(image):
    assert len(clear_points(image, 1, 6.0)) > 0.7 * image.size


def test_a_blank_image_is_refused():
    with pytest.raises(CorrelationError, match="blank; check the scan"):
        clear_points(np.full((20, 20, 20), 7, np.float32), 1, 4.0)


@pytest.mark.parametrize(
    ("cell", "spacing", "scale"), [(28, "auto", 1), (56, "auto", 2), (28, 4, 0.5)]
)
def test_levels_follow_the_cell_size(cell, spacing, scale):
    levels = freeform_options({"spacing": spacing}, cell, AXIS).levels
    for level, nominal in zip(levels, LEVELS, strict=True):
        assert level.spacing == scale * nominal.spacing
        assert level.cutoff == scale * nominal.cutoff
        assert level.stride >= 1
    assert levels[-1].stride == 1
