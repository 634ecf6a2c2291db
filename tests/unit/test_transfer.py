"""Appendix A: a displacement on the nodes of another mesh."""

import numpy as np
import pytest
import pyvista as pv
from numpy.testing import assert_allclose

from addvc.correlation.transfer import Projection, lattice_matrix, locate, transfer_matrix
from addvc.fem.mesh import Mesh, oriented
from addvc.geometry.grid import hex_grid

SLOPE = np.array([[0.01, 0.03, 0], [-0.02, -0.05, 0.01], [0, 0.02, 0.04]])


@pytest.fixture
def mesh(box):
    return box((0, 0, 0), (30, 40, 35), (4, 5, 4), shake=0.2)


def affine(points):
    """u (n, 3) of a uniform displacement gradient."""
    return points @ SLOPE.T + [1, -2, 0.5]


def test_affine_field_is_exact_inside(mesh, rng):
    x = rng.uniform(0, [30, 40, 35], (2000, 3))
    matrix, outside = transfer_matrix(mesh, x)
    assert outside == 0
    assert_allclose(matrix @ affine(mesh.points), affine(x), atol=1e-12)


def test_points_outside_are_counted_and_extrapolated(mesh, rng):
    x = np.vstack([rng.uniform(0, [30, 40, 35], (50, 3)), rng.uniform(-6, -1, (20, 3))])
    matrix, outside = transfer_matrix(mesh, x)
    assert outside == 20
    assert_allclose(matrix @ affine(mesh.points), affine(x), atol=1e-11)


def test_nodes_keep_their_values(mesh, rng):
    matrix, outside = transfer_matrix(mesh, mesh.points)
    field = rng.standard_normal(mesh.points.shape)
    assert outside == 0
    assert_allclose(matrix @ field, field, atol=1e-9)


def test_weights_of_a_point_inside_lie_between_zero_and_one(mesh, rng):
    cell, shape = locate(mesh, rng.uniform(0, [30, 40, 35], (500, 3)))
    assert shape.min() > -1e-9
    assert shape.max() < 1 + 1e-9
    assert cell.max() < len(mesh.cells)


def test_every_point_of_a_graded_mesh_is_found(rng):
    """Large cells beside many small ones: the nearest centroids are not those of the cell."""
    line = np.r_[np.linspace(0, 1, 8), 14, 27, 40]
    grid = pv.RectilinearGrid(line, line, line).to_tetrahedra(5)
    mesh = oriented(Mesh(np.asarray(grid.points), grid.cells_dict[pv.CellType.TETRA]))
    x = rng.uniform(0, 40, (3000, 3))
    matrix, outside = transfer_matrix(mesh, x)
    assert outside == 0
    quadratic = np.sum(mesh.points**2, axis=1)
    assert np.all(matrix @ quadratic >= np.sum(x**2, axis=1) - 1e-9)  # chords of a parabola


def test_from_a_lattice_an_affine_field_is_exact_even_outside(rng):
    lines = [np.array([0.0, 9, 20]), np.array([-3.0, 5, 12, 30]), np.array([0.0, 25])]
    mesh, x = hex_grid(lines), rng.uniform(-5, 35, (500, 3))
    assert_allclose(lattice_matrix(lines, mesh, x) @ affine(mesh.points), affine(x), atol=1e-12)


def test_a_change_goes_back_to_where_its_points_are(mesh, rng):
    """Affine there, zero at nodes whose cells have no point; a field is carried on beyond them."""
    x = rng.uniform([2, 2, 2], [15, 38, 33], (4000, 3))
    ones = np.ones(len(x))
    field, change = (Projection(mesh, x, ones, change=only) for only in (False, True))
    away = change.at_points.getnnz(axis=0) == 0
    assert away.any() and (change.nodal(affine(x))[away] == 0).all()
    assert np.abs(change.at_points @ change.nodal(affine(x)) - affine(x)).mean() < 1e-4
    assert np.abs(field.nodal(np.ones((len(x), 3)))[away] - 1).max() < 1e-3
