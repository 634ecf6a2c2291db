"""The platens that images show, beside the ends of what is measured between them."""

import numpy as np
import pytest

from addvc.analysis.platens_check import beside, opened, platen_faces
from addvc.report.doubts import strain_warnings
from addvc.report.sentences import state_words


@pytest.fixture
def foam(rng):
    """foam(low, high): noise between bright slabs along y, which end at these rows."""

    def make(low, high):
        volume = rng.normal(20, 2, (40, 60, 40)).astype(np.float32)
        volume[:, :low], volume[:, high:] = 150, 150
        return volume

    return make


def test_faces_are_where_the_slabs_end_and_the_gap_closes(foam):
    faces = platen_faces(foam(10, 50), foam(11, 45), 1)
    np.testing.assert_allclose(faces["before"], [9.5, 49.5], atol=0.05)
    np.testing.assert_allclose(faces["now"], [10.5, 44.5], atol=0.05)
    along = np.linspace(9.5, 49.5, 401)
    found = beside(faces, along, np.interp(along, [9.5, 49.5], [1, -5]))
    assert found["strain"] == pytest.approx(6 / 40, abs=2e-3)
    np.testing.assert_allclose(found["moved"], [1, -5], atol=0.05)
    assert found["apart"] < 0.15  # the slope within NEAR of a face


@pytest.mark.parametrize("rows", [(10, 60), (0, 50), (0, 60)])
def test_one_platen_or_none_tells_nothing(foam, rows):
    assert platen_faces(foam(*rows), foam(*rows), 1) is None
    assert beside(None, np.arange(5.0), np.zeros(5)) is None


def test_a_mesh_that_ends_elsewhere_is_not_compared():
    faces = {"before": [10.0, 50.0], "now": [10.0, 48.0]}
    assert beside(faces, np.linspace(20, 50, 31), np.zeros(31)) is None


def test_scans_in_a_wrong_order_are_told_at_once():
    """The gap closes from state to state: 40, 38, 30; in any other order it opens somewhere."""
    faces = lambda first, *rest: {  # noqa: E731
        n: {"before": [10.0, 10.0 + first], "now": [10.0, 10.0 + gap]}
        for n, gap in enumerate(rest, 1)
    }
    assert opened(faces(40, 38, 30)) == ""
    assert opened({1: None, 2: None}) == ""
    assert "38.0 voxels apart in state 2, in state 1 30.0" in opened(faces(40, 30, 38))
    assert "40.0 voxels apart in state 1, in the reference 30.0" in opened(faces(30, 40, 38))
    assert opened({1: None} | {2: faces(40, 38)[1]}) == ""


def test_ends_that_do_not_go_with_the_platens_are_warned_of():
    faces, along = {"before": [10.0, 50.0], "now": [10.0, 40.0]}, np.array([10.0, 30.0, 50.0])
    known = {"state": 2, "label": "state 2", "strain": 0.25}
    right = known | {"platens": beside(faces, along, np.array([0.1, -5.0, -9.8]))}
    lost = known | {"platens": beside(faces, along, np.array([0.1, -5.0, -6.5]))}
    assert strain_warnings({"states": [right]}) == []
    (told,) = strain_warnings({"states": [right | {"state": 1}, lost]})
    assert "In state 2 the platens have moved by +0.00 and -10.00 voxels" in told
    assert "by +0.10 and -6.50 (at most 0.5 apart)" in told
    assert state_words(lost) == "2 (25.0% compression measured, 25.0% by the platens)"
