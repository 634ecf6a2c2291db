"""Virtual states: the displacement is the one by which the image was warped, at any binning."""

import numpy as np
import pytest
from scipy import ndimage

from addvc.errors import AddvcError
from addvc.images.levels import bin_mean, to_fine
from addvc.twin.virtual import VirtualField, warp

FIELD = VirtualField((0.02, 0.05), axis=1, low=3.0, amplitude=0.4, wavelength=40.0)
SHAPE = (36, 40, 32)  # of the binned image
MARGIN = 6


def blobs(factor):
    """Smooth grey levels on the scan, `factor` times finer than SHAPE, of one specimen."""
    rng = np.random.default_rng(2417)
    grids = np.meshgrid(
        *((np.arange(factor * n) - (factor - 1) / 2) / factor for n in SHAPE), indexing="ij"
    )
    volume = np.full([factor * n for n in SHAPE], 20.0)
    for centre in rng.random((12, 3)) * SHAPE:
        square = sum((x - c) ** 2 for x, c in zip(grids, centre, strict=True))
        volume += 100 * np.exp(-square / (2 * 5.0**2))
    return volume.astype(np.float32)


def inner_points(count=2000):
    """Points of the binned reference that stay inside in every state."""
    span = np.array(SHAPE) - 1 - 2 * MARGIN
    return MARGIN + span * np.random.default_rng(2417).random((count, 3))


def grey(volume, points):
    return ndimage.map_coordinates(volume.astype(float), points.T, order=3, mode="mirror")


# ----------------------------------------------------------------------------------- field


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("state", [1, 2])
def test_displacement_solves_its_equation(axis, state):
    field = VirtualField((0.02, 0.2), axis, amplitude=0.5, wavelength=80.0)
    x = 500 * np.random.default_rng(2417).random((1000, 3))
    u = field.displacement(x, state)
    np.testing.assert_allclose(u, field.pulled_back(x + u, state), rtol=0, atol=1e-10)


def test_the_top_moves_down_and_the_low_end_stays():
    """The mean slope along the axis is minus the strain, which is of the reference."""
    field = VirtualField((0.1,), axis=1, low=5.0, amplitude=0.0)
    x = np.array([[9.0, 5.0, 9.0], [9.0, 60.0, 9.0]])
    expected = [[0, 0, 0], [0, -0.1 * 55, 0]]
    np.testing.assert_allclose(field.displacement(x, 1), expected, atol=1e-10)


def test_waves_grow_with_the_strain():
    still = VirtualField((0.02, 0.04), 0, amplitude=0.0)
    waves = VirtualField((0.02, 0.04), 0, amplitude=0.5)
    y = 100 * np.random.default_rng(2417).random((500, 3))
    one, two = (waves.pulled_back(y, state) - still.pulled_back(y, state) for state in (1, 2))
    np.testing.assert_allclose(two, 2 * one, atol=1e-12)
    assert 0.4 < np.abs(one).max() <= 0.5


def test_a_field_survives_the_disk(tmp_path):
    FIELD.save(tmp_path / "truth/virtual.json")
    found = VirtualField.load(tmp_path / "truth/virtual.json")
    x = inner_points(50)
    np.testing.assert_array_equal(found.displacement(x, 2), FIELD.displacement(x, 2))


@pytest.mark.parametrize("use", ["displacement", "image"])
def test_a_field_that_folds_is_an_error_the_user_can_mend(use):
    """Nor is a scan made of a state that no displacement describes."""
    with pytest.raises(AddvcError, match=r"state 1 folds .*amplitude 4\.0 .*20\.0; lower the"):
        field = VirtualField((0.3,), axis=1, amplitude=4.0, wavelength=20.0)
        if use == "image":
            warp(blobs(1), field, 1, 1, 0.0, 2417)
        field.displacement(inner_points(100), 1)


# ------------------------------------------------------------------------------------ warp


@pytest.mark.parametrize("state", [1, 2])
@pytest.mark.parametrize("factor", [1, 2])
def test_the_warped_scan_obeys_the_displacement(factor, state):
    """I_d(x + u) = I_r(x), x and u changed to the voxels of the scan."""
    reference = blobs(factor)
    deformed = warp(reference, FIELD, state, factor, 0.0, 2417)
    x = inner_points()
    u = FIELD.displacement(x, state)
    moved, rest = grey(deformed, to_fine(x + u, factor)), grey(reference, to_fine(x, factor))
    assert np.abs(u).max() > 0.5
    assert np.abs(grey(deformed, to_fine(x, factor)) - rest).max() > 3
    np.testing.assert_allclose(moved, rest, rtol=0, atol=0.02)


@pytest.mark.parametrize("state", [1, 2])
def test_the_warped_scan_obeys_the_displacement_once_it_is_binned(state):
    """Half a voxel of the scan, lost at a change of level, would cost over ten times as much."""
    reference, fine = bin_mean(blobs(2), 2), warp(blobs(2), FIELD, state, 2, 0.0, 2417)
    deformed = bin_mean(fine, 2)
    x = inner_points()
    u = FIELD.displacement(x, state)
    error = np.abs(grey(deformed, x + u) - grey(reference, x))
    shifted = np.abs(grey(deformed, x + u) - grey(reference, x + 0.25))
    assert error.max() < 0.05 < 0.5 < shifted.max()

    without_shift = FIELD.displacement(x + 0.25, state)  # positions halved with no shift of centres
    wrong = np.abs(grey(deformed, x + without_shift) - grey(reference, x))
    assert wrong.max() > 4 * error.max()


def test_noise_has_its_deviation_and_is_fresh_in_each_state():
    flat = np.full((24, 24, 24), 100, np.float32)
    one, two, again = (warp(flat, FIELD, state, 1, 3.0, 2417) - 100 for state in (1, 2, 1))
    assert one.dtype == np.float32
    assert one.std() == pytest.approx(3, rel=0.03)
    assert one.mean() == pytest.approx(0, abs=0.1)
    assert abs(np.corrcoef(one.ravel(), two.ravel())[0, 1]) < 0.05
    np.testing.assert_array_equal(one, again)
    assert not np.array_equal(one, warp(flat, FIELD, 1, 1, 3.0, 2418) - 100)


@pytest.mark.parametrize("dtype", ["uint8", "uint16", ">u2", "int16"])
def test_whole_numbers_are_rounded_and_clipped(dtype):
    """Values beyond the range stay at its ends; they do not come round on the other side."""
    limits = np.iinfo(dtype)
    for level, beyond in ((limits.max - 1, limits.max), (limits.min + 1, limits.min)):
        moved = warp(np.full((20, 20, 20), level, dtype), FIELD, 1, 1, 20.0, 2417)
        assert moved.dtype == np.dtype(dtype)
        assert (moved == beyond).mean() == pytest.approx(0.5, abs=0.05)
        assert np.abs(moved.astype(float) - level).max() < 150


def test_no_noise_and_no_strain_give_the_scan_back():
    still = VirtualField((1e-9,), axis=0, amplitude=0.0)
    scan = np.random.default_rng(2417).integers(0, 255, (20, 22, 24), dtype=np.uint8)
    np.testing.assert_array_equal(warp(scan, still, 1, 1, 0.0, 2417), scan)
