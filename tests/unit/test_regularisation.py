"""Eq. 9 to 11: weights, what is penalised, and what is not."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import sparse

from addvc.correlation.regularisation import (
    diffusion,
    equilibrium_gap,
    gap,
    quadratic,
    shear_wave,
    tikhonov_weight,
)
from addvc.fem.mesh import boundary_faces
from addvc.fem.operators import laplacian, stiffness, vectorised

NU, PERIOD, AXIS = 0.28, 15.0, 1


@pytest.fixture
def mesh(box):
    return box((0, 0, 0), (20, 30, 24), (3, 5, 4), shake=0.15)


@pytest.fixture
def hessian(mesh, rng):
    """Any symmetric positive definite matrix (3 n, 3 n)."""
    return sparse.diags(rng.uniform(1, 2, 3 * len(mesh.points))).tocsr()


@pytest.fixture
def ends(mesh):
    """Nodes on the two ends, (n,) bool."""
    return (mesh.points[:, AXIS] == 0) | (mesh.points[:, AXIS] == 30)


def gap_of(mesh, hessian, penalised, l_k=10.0, l_l=10.0, period=PERIOD):
    return equilibrium_gap(mesh, hessian, penalised, l_k, l_l, period, NU, AXIS)


def test_trial_wave_has_its_period_and_direction(mesh):
    v = shear_wave(mesh.points, AXIS, PERIOD).reshape(-1, 3)
    assert_allclose(v[:, [0, 2]], 0)
    for periods, factor in ((1, 1), (0.5, -1)):
        further = mesh.points + periods * PERIOD * np.eye(3)[AXIS]
        assert_allclose(shear_wave(further, AXIS, PERIOD), factor * v.ravel(), atol=1e-12)


def test_weight_is_one_at_the_period_and_grows_with_its_order():
    assert tikhonov_weight(PERIOD, PERIOD) == 1
    assert tikhonov_weight(30.0, 15.0) == 16
    assert tikhonov_weight(30.0, 15.0, order=2) == 4


def test_gap_is_a_squared_norm_over_the_selected_nodes(mesh, ends, rng):
    k = stiffness(mesh, NU)
    v = rng.standard_normal(k.shape[0])
    force = (k @ v).reshape(-1, 3)
    assert quadratic(gap(k, ends), v) == pytest.approx(np.sum(force[ends] ** 2))


def test_each_term_equals_its_share_of_the_grey_levels_on_the_trial_wave(mesh, hessian, ends):
    """Eq. 10, 11: v^T M_K v = lambda_K S(v), and the same for L."""
    v = shear_wave(mesh.points, AXIS, PERIOD)
    m, weights = gap_of(mesh, hessian, ends, l_k=9.0, l_l=12.0)
    m_k = weights["c1"] * gap(stiffness(mesh, NU), ~ends)
    m_l = weights["c2"] * gap(vectorised(laplacian(mesh)), ends)
    assert weights["S_v"] == pytest.approx(v @ (hessian @ v))
    assert quadratic(m_k, v) == pytest.approx(tikhonov_weight(9.0, PERIOD) * weights["S_v"])
    assert quadratic(m_l, v) == pytest.approx(tikhonov_weight(12.0, PERIOD) * weights["S_v"])
    assert abs(m - (m_k + m_l)).max() < 1e-10 * abs(m).max()


def test_weights_grow_with_the_fourth_power_of_the_cutoff(mesh, hessian, ends):
    _, short = gap_of(mesh, hessian, ends)
    _, long = gap_of(mesh, hessian, ends, l_k=30.0, l_l=20.0)
    assert long["c1"] / short["c1"] == pytest.approx(81)
    assert long["c2"] / short["c2"] == pytest.approx(16)


def test_brighter_images_need_no_other_cutoff(mesh, hessian, ends):
    """Grey levels times g scale H by g^2, and M with it: the solution stays."""
    m, _ = gap_of(mesh, hessian, ends)
    brighter, _ = gap_of(mesh, 9 * hessian, ends)
    assert abs(brighter - 9 * m).max() < 1e-12 * abs(brighter).max()


def test_gap_is_symmetric_and_semi_definite(mesh, hessian, ends):
    m, _ = gap_of(mesh, hessian, ends)
    assert abs(m - m.T).max() < 1e-14 * abs(m).max()
    values = np.linalg.eigvalsh(m.toarray())
    assert values[0] > -1e-10 * values[-1]


def test_rigid_motions_cost_nothing_in_the_bulk(mesh, hessian, rigid_motions):
    nowhere = np.zeros(len(mesh.points), dtype=bool)
    m, weights = gap_of(mesh, hessian, nowhere)
    assert weights["c2"] == 0
    assert_allclose(m @ rigid_motions(mesh.points), 0, atol=1e-9 * abs(m).max())


def test_penalised_nodes_may_translate(mesh, hessian, ends, rigid_motions):
    m, _ = gap_of(mesh, hessian, ends)
    assert_allclose(m @ rigid_motions(mesh.points)[:, :3], 0, atol=1e-9 * abs(m).max())


def test_affine_fields_cost_nothing_on_inner_nodes(mesh, rng):
    inner = np.ones(len(mesh.points), dtype=bool)
    inner[boundary_faces(mesh)] = False
    u = (mesh.points @ rng.standard_normal((3, 3))).ravel()
    for operator in (stiffness(mesh, NU), vectorised(laplacian(mesh))):
        assert abs(quadratic(gap(operator, inner), u)) < 1e-12 * quadratic(gap(operator, ~inner), u)


def test_all_nodes_penalised_leaves_the_curvature_alone(mesh, hessian):
    everywhere = np.ones(len(mesh.points), dtype=bool)
    m, weights = gap_of(mesh, hessian, everywhere)
    assert weights["c1"] == 0
    expected = weights["c2"] * gap(vectorised(laplacian(mesh)), everywhere)
    assert abs(m - expected).max() == 0


def test_diffusion_has_order_two_and_lets_translations_go(mesh, hessian, rigid_motions):
    m = diffusion(mesh, hessian, cutoff=10.0, period=PERIOD, axis=AXIS)
    v = shear_wave(mesh.points, AXIS, PERIOD)
    assert quadratic(m, v) == pytest.approx((10 / PERIOD) ** 2 * quadratic(hessian, v))
    assert_allclose(m @ rigid_motions(mesh.points)[:, :3], 0, atol=1e-10 * abs(m).max())
    assert abs(m - m.T).max() < 1e-14 * abs(m).max()
