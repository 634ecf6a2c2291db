"""Brightness and contrast of a state brought to those of the reference."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from addvc.errors import ScanError
from addvc.images.grey import Levels, corrected, grey_levels, matched

AXIS = 1
NOISE = 4.0


@pytest.fixture
def foam(rng):
    """foam(share, noise): plates of 200 in void of 20, platens of 220; `share` is solid."""

    def make(share, noise=NOISE):
        image = np.full((40, 60, 40), 20.0)
        image[: round(40 * share)] = 200.0
        image[:, :8] = image[:, -8:] = 220.0
        return (image + noise * rng.standard_normal(image.shape)).astype(np.float32)

    return make


@pytest.mark.parametrize("share", [0.05, 0.1, 0.3])
def test_levels_do_not_depend_on_how_much_is_solid(foam, share):
    levels = grey_levels(foam(share), AXIS)
    assert_allclose([levels.void, levels.solid], [20, 200], atol=0.5)


def test_little_solid_in_much_noise_is_found_or_refused(foam):
    levels = grey_levels(foam(0.03, 30.0), AXIS)
    assert_allclose([levels.void, levels.solid], [20, 200], atol=6)
    with pytest.raises(ScanError, match="within 2 deviations of the void"):
        grey_levels(foam(0.03, 50.0), AXIS)


@pytest.mark.parametrize(("gain", "offset"), [(0.8, 12.0), (1.3, -7.0)])
def test_drift_is_undone(foam, gain, offset):
    reference, state = foam(0.1), foam(0.15)
    drifted = (gain * state + offset).astype(np.float32)
    found = matched(drifted, grey_levels(drifted, AXIS), grey_levels(reference, AXIS))
    assert found.dtype == np.float32
    assert_allclose(found, state, atol=0.02 * 180)


@pytest.mark.parametrize(
    ("shift", "found"), [(0.0, False), (0.1, False), (1.0, True), (-1.0, True)]
)
def test_by_itself_a_clear_drift_alone_is_undone(foam, shift, found, caplog):
    """A quarter of the noise is clear, a fortieth is not."""
    reference, state = foam(0.1), foam(0.15) + np.float32(shift)
    same = corrected(state, reference, AXIS, "auto")
    assert ("brought to these" in caplog.text) == found == (same is not state)
    assert_allclose(grey_levels(same, AXIS).void, grey_levels(reference, AXIS).void, atol=0.15)


def test_by_itself_what_cannot_be_told_is_left(foam):
    blank = np.full((20, 20, 20), 7, np.float32)
    assert corrected(blank, foam(0.1), AXIS, "auto") is blank
    with pytest.raises(ScanError, match="all the same"):
        corrected(blank, foam(0.1), AXIS, "global")


def test_another_scan_altogether_is_refused(foam):
    with pytest.raises(ScanError, match="scans of the same specimen"):
        matched(foam(0.1), Levels(20, 30), Levels(20, 200))


def test_a_blank_scan_is_refused():
    with pytest.raises(ScanError, match="check the scan, or use"):
        grey_levels(np.full((20, 20, 20), 7, np.float32), AXIS)
