"""The choice of the start of micro DVC: what the score is made of, and who wins."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from addvc.correlation.metric import hessian
from addvc.correlation.micro import MicroOptions, micro_reference
from addvc.correlation.micro_start import best_candidate, elastic_energy, judge, judged
from addvc.correlation.regularisation import elastic_weight
from addvc.errors import CorrelationError
from addvc.fem.assembly import node_pattern
from addvc.fem.operators import stiffness, strain

OPTIONS = MicroOptions(axis=1, l_k=20.0, l_l=20.0, l_e=10.0, period=20.0)
SHIFT = (2, -1, 1)


@pytest.fixture
def mesh(box):
    return box((6, 6, 6), (33, 33, 33), (4, 4, 4), shake=0.1)


@pytest.fixture
def images(speckle):
    """I_r with texture below x = 20 only, and the same moved by SHIFT."""
    volume = speckle((40, 40, 40))
    volume[20:] = 110
    return volume, np.roll(volume, SHIFT, axis=(0, 1, 2))


@pytest.fixture
def court(mesh, images):
    return judge(micro_reference(mesh, images[0]), OPTIONS, scale=20.0)


def moved(mesh):
    return np.zeros_like(mesh.points) + np.array(SHIFT)


def test_energy_of_small_strains_is_that_of_the_stiffness(mesh, rng):
    u = 1e-3 * rng.normal(size=mesh.points.shape)
    k = stiffness(mesh, OPTIONS.nu)
    expected = u.ravel() @ (k @ u.ravel())
    assert elastic_energy(mesh, strain(mesh, u), OPTIONS.nu) == pytest.approx(expected)


def test_turning_costs_nothing(mesh):
    turn = Rotation.from_rotvec([0.3, -0.5, 0.8]).as_matrix()
    u = mesh.points @ turn.T - mesh.points
    assert elastic_energy(mesh, strain(mesh, u, finite=True), OPTIONS.nu) < 1e-20


def test_weight_is_that_of_the_default_method(mesh, court):
    h = hessian(court.reference, node_pattern(mesh))
    k = stiffness(mesh, OPTIONS.nu)
    expected = elastic_weight(mesh, h, k, OPTIONS.l_e, OPTIONS.period, OPTIONS.axis)
    assert court.weight == pytest.approx(expected, rel=1e-5)


def test_the_right_motion_has_no_score(mesh, court, images):
    found = judged(court, images[1], moved(mesh))
    assert_allclose([found["score"], found["robust_std"], found["elastic_strain"]], 0, atol=1e-9)
    assert found["outside"] == 0


def test_who_fits_wins(mesh, court, images):
    candidates = {"rest": np.zeros_like(mesh.points), "right": moved(mesh)}
    best, table = best_candidate(court, images[1], candidates)
    assert best == "right"
    assert [row["candidate"] for row in table] == ["rest", "right"]
    assert table[0]["score"] > table[1]["score"]


def test_of_two_that_fit_alike_the_one_with_less_energy_wins(mesh, court, images, rng):
    """Nodes beyond the texture may go anywhere, as far as the image can tell."""
    torn = moved(mesh)
    torn[mesh.points[:, 0] > 28] += rng.normal(size=3)
    best, table = best_candidate(court, images[1], {"torn": torn, "whole": moved(mesh)})
    assert best == "whole"
    assert table[0]["robust_std"] == pytest.approx(table[1]["robust_std"], abs=1e-6)
    assert table[0]["elastic_strain"] > 0.01


def test_a_lost_point_costs_its_scale_and_no_more(mesh, court, images):
    far = np.zeros_like(mesh.points) + np.array([500.0, 0, 0])
    found = judged(court, images[1], far)
    assert found["outside"] == len(court.reference.quadrature)
    assert found["score"] == pytest.approx(court.scale**2)


def test_a_candidate_that_diverged_is_never_taken(mesh, court, images):
    lost = np.full_like(mesh.points, np.nan)
    best, _ = best_candidate(court, images[1], {"lost": lost, "rest": np.zeros_like(lost)})
    assert best == "rest"
    with pytest.raises(CorrelationError, match=r"none of the 1 starts of micro DVC \(lost\)"):
        best_candidate(court, images[1], {"lost": lost})
