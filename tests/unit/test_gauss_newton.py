"""The loop and the reduced basis: they know no images, so a quadratic form will do."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy import sparse

from addvc.correlation.gauss_newton import gauss_newton, rms
from addvc.correlation.reduced_basis import reduced_solve, scale_factors, scaling_basis

TRUTH = np.random.default_rng(2417).standard_normal((20, 3))


def spring(stiffness):
    """b(u) of a quadratic form whose minimum is TRUTH."""
    return lambda u: stiffness * (TRUTH - u).ravel()


def test_quadratic_form_is_minimised_in_one_step_and_confirmed_by_the_next():
    start = np.zeros_like(TRUTH)
    solution = gauss_newton(spring(3.0), lambda b: b / 3, start)
    assert_allclose(solution.u, TRUTH, atol=1e-14)
    assert solution.converged
    assert solution.history == pytest.approx([rms(TRUTH), 0], abs=1e-14)
    assert_array_equal(start, 0)


def test_steps_of_a_modified_hessian_shrink_by_its_ratio():
    solution = gauss_newton(spring(1.0), lambda b: b / 2, np.zeros_like(TRUTH), tolerance=1e-6)
    assert solution.converged
    assert_allclose(np.divide(solution.history[1:], solution.history[:-1]), 0.5, rtol=1e-6)
    assert solution.history[-1] < 1e-6 <= solution.history[-2]


def test_too_few_iterations_are_no_convergence():
    solution = gauss_newton(spring(1.0), lambda b: b / 2, np.zeros_like(TRUTH), 1e-6, 5)
    assert (solution.converged, solution.iterations) == (False, 5)


def test_divergence_ends_the_loop_and_is_no_convergence():
    with np.errstate(over="ignore", invalid="ignore"):
        solution = gauss_newton(spring(1.0), lambda b: -1e200 * b, np.zeros_like(TRUTH))
    assert not solution.converged
    assert not np.isfinite(solution.history[-1])
    assert solution.iterations < 5


def test_progress_hears_of_each_step():
    heard = []
    solution = gauss_newton(spring(1.0), lambda b: b / 2, np.zeros_like(TRUTH),
                            progress=lambda *step: heard.append(step))  # fmt: skip
    assert heard == list(enumerate(solution.history, start=1))


def test_rms_is_that_of_lengths():
    assert rms(np.array([[3.0, 4, 0], [0, 0, 0]])) == pytest.approx(np.sqrt(12.5))


def test_basis_scales_each_component_by_itself():
    scaled = scaling_basis(TRUTH) @ [2.0, -1.0, 0.5]
    assert_allclose(scaled.reshape(-1, 3), TRUTH * [2, -1, 0.5])


def test_component_without_scale_gets_a_translation():
    w = TRUTH * [1, 1, 0]
    moved = scaling_basis(w) @ [0.0, 0.0, 0.7]
    assert_allclose(moved.reshape(-1, 3), np.broadcast_to([0, 0, 0.7], w.shape))


def test_reduced_step_minimises_within_the_basis(rng):
    """Eq. 6: b - H d is orthogonal to the basis."""
    root = rng.standard_normal((60, 60))
    h, b = sparse.csr_matrix(root @ root.T), rng.standard_normal(60)
    basis = scaling_basis(TRUTH)
    step = reduced_solve(h, basis)(b)
    assert_allclose(basis.T @ (b - h @ step), 0, atol=1e-9)
    assert_allclose(basis @ np.linalg.lstsq(basis, step)[0], step, atol=1e-12)


def test_scale_factors_are_read_back():
    assert scale_factors(TRUTH * [1.1, 0.9, -2], TRUTH) == pytest.approx([1.1, 0.9, -2])
