"""The solvers: exact to round-off for any numbering, and plain about singular systems."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy import sparse

from addvc.errors import CorrelationError
from addvc.fem import solver as solvers
from addvc.fem.mesh import Mesh
from addvc.fem.operators import laplacian, stiffness, vectorised
from addvc.fem.solver import conjugate_gradients, dissection, factorise, solver


@pytest.fixture
def mesh(box):
    return box((0, 0, 0), (10, 12, 11), (5, 6, 5), shake=0.15)


def system(mesh):
    """A matrix (3 n, 3 n) like those of micro DVC: K^T K and a little of the identity."""
    k = stiffness(mesh, 0.28)
    return k.T @ k + 1e-3 * sparse.identity(k.shape[0], format="csr")


def test_solution_to_round_off(mesh, rng):
    a = system(mesh)
    x = rng.standard_normal(a.shape[0])
    assert_allclose(factorise(a).solve(a @ x), x, atol=1e-10)


def test_factor_times_its_transpose_is_the_permuted_matrix(mesh):
    a = system(mesh)
    factor = factorise(a)
    permuted = a.tocsr()[factor.order][:, factor.order]
    assert abs(factor.lower @ factor.lower.T - permuted).max() < 1e-12
    assert sparse.triu(factor.lower, 1).nnz == 0
    assert factor.nonzeros == factor.lower.nnz


def test_numbering_of_the_nodes_does_not_matter(mesh, rng):
    other = rng.permutation(len(mesh.points))  # node other[i] of the mesh is node i now
    renumbered = Mesh(mesh.points[other], np.argsort(other)[mesh.cells])
    b = rng.standard_normal(mesh.points.shape)
    x = factorise(system(mesh)).solve(b.ravel()).reshape(-1, 3)
    y = factorise(system(renumbered)).solve(b[other].ravel()).reshape(-1, 3)
    assert_allclose(y, x[other], atol=1e-9 * np.abs(x).max())


def test_order_is_a_permutation_that_keeps_nodes_together_and_fills_less(mesh, rng):
    a = system(mesh)
    order = dissection(a)
    assert_array_equal(np.sort(order), np.arange(a.shape[0]))
    by_node = order.reshape(-1, 3)
    assert_array_equal(by_node, by_node[:, :1] + [0, 1, 2])
    assert factorise(a, order).nonzeros < factorise(a, rng.permutation(a.shape[0])).nonzeros


def test_nodes_without_neighbours_are_solved_too():
    a = sparse.identity(12, format="csr") * 4
    assert_allclose(factorise(a).solve(np.arange(12.0)), np.arange(12) / 4)


def test_dissection_leaves_the_matrix_alone(mesh):
    a = stiffness(mesh, 0.28)
    before = a.copy()
    dissection(a)
    assert abs(a - before).max() == 0
    assert_array_equal(a.indices, before.indices)


@pytest.mark.parametrize("count", [2, 3, 4, 6])
@pytest.mark.parametrize("operator", ["K", "L"])
def test_singular_matrix_is_an_error(box, count, operator):
    """K without a hold has six rigid motions, L three: pivots that vanish but for round-off."""
    mesh = box((0, 0, 0), (10, 12, 11), (count,) * 3)
    a = stiffness(mesh, 0.28) if operator == "K" else vectorised(laplacian(mesh))
    with pytest.raises(CorrelationError, match=r"not positive definite.* use larger elements or"):
        factorise(a)


def test_indefinite_matrix_is_an_error(mesh):
    with pytest.raises(CorrelationError, match=r"system of \d+ unknowns is not positive definite"):
        factorise(-1.0 * system(mesh))


@pytest.fixture
def smooth(mesh, rng):
    """A matrix like those of meso DVC: a mass that differs from node to node, and a Laplacian."""
    slope = rng.normal(size=(len(mesh.points), 3, 3))
    data = sparse.block_diag(slope @ slope.transpose(0, 2, 1))
    return (data + 2.0 * vectorised(laplacian(mesh))).tocsr()


def test_conjugate_gradients_solve_as_the_factor_does(smooth, rng):
    b = rng.standard_normal(smooth.shape[0])
    x, exact = conjugate_gradients(smooth).solve(b), factorise(smooth).solve(b)
    assert np.linalg.norm(smooth @ x - b) < 1.01e-10 * np.linalg.norm(b)
    assert_allclose(x, exact, atol=1e-7 * np.abs(exact).max())
    assert_array_equal(conjugate_gradients(smooth).solve(b), x)
    assert not conjugate_gradients(smooth).solve(0 * b).any()


def test_large_systems_get_no_factor(smooth, monkeypatch):
    assert solver(smooth).nonzeros == factorise(smooth).nonzeros
    monkeypatch.setattr(solvers, "DIRECT", smooth.shape[0] - 1)
    assert solver(smooth).nonzeros == smooth.tobsr((3, 3)).nnz


def test_steps_that_do_not_do_are_told(smooth, rng, monkeypatch):
    monkeypatch.setattr(solvers, "MOST_STEPS", 3)
    with pytest.raises(
        CorrelationError, match=r"after 3 steps .* is left \(limit 1e-10\); use larger"
    ):
        conjugate_gradients(smooth).solve(rng.standard_normal(smooth.shape[0]))


def test_a_node_that_nothing_holds_is_told(smooth):
    loose = sparse.block_diag([smooth, sparse.csr_matrix((3, 3))])
    with pytest.raises(CorrelationError, match=r"not positive definite .*eigenvalue of"):
        conjugate_gradients(loose)
