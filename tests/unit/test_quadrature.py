"""Points of a quadrature: voxels are shared out once, polynomials are integrated exactly."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from addvc.errors import MeshError
from addvc.fem.mesh import cell_volumes
from addvc.fem.quadrature import (
    barycentric,
    dither,
    gauss_points,
    interpolate,
    lattice_points,
    locate_in_lattice,
    thinned,
    voxel_points,
)
from addvc.geometry.grid import hex_grid

SHAPE = (20, 22, 18)


@pytest.fixture
def mesh(box):
    """Nodes and faces fall on voxel centres as often as can be."""
    return box((2, 3, 1), (14, 18, 13), (3, 5, 4))


def test_gauss_points_integrate_quadratics_over_a_box(box):
    mesh = box((0, 0, 0), (2, 3, 4), (2, 2, 2), shake=0.2)
    quadrature = gauss_points(mesh)
    x, y, z = quadrature.points.T
    assert quadrature.weight.sum() == pytest.approx(24)
    assert quadrature.weight @ (x * y) == pytest.approx(2 * 4.5 * 4)
    assert quadrature.weight @ z**2 == pytest.approx(6 * 64 / 3)
    assert_allclose(np.bincount(quadrature.cell, quadrature.weight), cell_volumes(mesh))


@pytest.mark.parametrize("shake", [0.0, 0.2])
def test_voxels_of_a_box_are_each_owned_once(box, shake):
    mesh = box((2, 3, 1), (14, 18, 13), (3, 5, 4), shake)
    quadrature = voxel_points(mesh, SHAPE)
    first = np.array([2, 3, 1])
    expected = first + np.argwhere(np.ones((13, 16, 13)))
    assert_array_equal(quadrature.points, expected)
    assert_array_equal(quadrature.weight, 1)


def test_voxels_lie_in_the_cells_that_own_them(mesh):
    quadrature = voxel_points(mesh, SHAPE)
    assert quadrature.shape.min() > -1e-9
    assert_allclose(quadrature.shape.sum(axis=1), 1, atol=1e-12)
    back = interpolate(mesh.cells, quadrature.cell, quadrature.shape, mesh.points)
    assert_allclose(back, quadrature.points, atol=1e-12)


def test_voxel_on_a_shared_face_goes_to_the_cell_with_the_smaller_number(mesh):
    quadrature = voxel_points(mesh, SHAPE)
    owner = np.full(len(quadrature), len(mesh.cells))
    for cell in reversed(range(len(mesh.cells))):
        weights = barycentric(mesh, np.full(len(quadrature), cell), quadrature.points)
        owner[weights.min(axis=1) > -1e-9] = cell
    assert_array_equal(quadrature.cell, owner)


def test_half_voxel_box_counts_its_voxels_as_its_volume(box):
    mesh = box((1.5, 2.5, 0.5), (13.5, 17.5, 12.5), (3, 5, 4), shake=0.2)
    assert len(voxel_points(mesh, SHAPE)) == round(cell_volumes(mesh).sum())


def test_dithered_points_stay_in_their_voxels_and_are_carried_where_they_are(mesh):
    centres, points = voxel_points(mesh, SHAPE), voxel_points(mesh, SHAPE, dithered=True)
    assert np.abs(points.points - centres.points).max() <= 0.5
    assert_array_equal(points.cell, centres.cell)
    assert_array_equal(points.weight, centres.weight)
    back = interpolate(mesh.cells, points.cell, points.shape, mesh.points)
    assert_allclose(back, points.points, atol=1e-12)


def test_dither_fills_voxels_evenly_and_stays_in_the_image():
    centres = np.argwhere(np.ones(SHAPE)).astype(float)
    assert dither(centres, SHAPE).min() == 0
    assert (dither(centres, SHAPE) <= np.array(SHAPE) - 1).all()
    inner = centres[((centres > 0) & (centres < np.array(SHAPE) - 1)).all(axis=1)]
    count, _ = np.histogramdd(dither(inner, SHAPE) - inner, bins=4, range=[(-0.5, 0.5)] * 3)
    assert_allclose(count / count.mean(), 1, atol=0.15)


def test_mesh_may_reach_beyond_the_image(box):
    mesh = box((-5, -5, -5), (30, 30, 30), (3, 3, 3))
    assert len(voxel_points(mesh, SHAPE)) == np.prod(SHAPE)


def test_mesh_outside_the_image_is_an_error(box):
    mesh = box((30, 30, 30), (40, 40, 40), (2, 2, 2))
    with pytest.raises(MeshError, match=r"of the image \(20, 22, 18\) .* check the units"):
        voxel_points(mesh, SHAPE)


def test_barycentric_coordinates_reproduce_points_even_outside(mesh):
    x = np.random.default_rng(2417).uniform(-20, 40, (300, 3))
    cell = np.random.default_rng(6113).integers(0, len(mesh.cells), 300)
    weights = barycentric(mesh, cell, x)
    assert_allclose(np.einsum("qa,qai->qi", weights, mesh.points[mesh.cells[cell]]), x, atol=1e-10)


LINES = [np.array([0.0, 4.0, 13.0, 19.0]), np.array([1.5, 7.2, 15.0]), np.array([0.0, 8.5, 17.0])]


def test_lattice_shares_out_its_voxels_once():
    quadrature = lattice_points(LINES, SHAPE)
    first = np.array([0, 2, 0])
    assert_array_equal(quadrature.points, first + np.argwhere(np.ones((20, 14, 18))))
    assert quadrature.shape.min() >= 0
    assert_allclose(quadrature.shape.sum(axis=1), 1, atol=1e-12)


def test_lattice_numbers_its_cells_as_the_grid_does():
    mesh, quadrature = hex_grid(LINES), lattice_points(LINES, SHAPE)
    back = interpolate(mesh.cells, quadrature.cell, quadrature.shape, mesh.points)
    assert_allclose(back, quadrature.points, atol=1e-12)


def test_points_outside_a_lattice_are_extrapolated():
    mesh, x = hex_grid(LINES), np.array([[-3.0, 30.0, 8.0], [25.0, -4.0, 40.0]])
    cell, shape = locate_in_lattice(LINES, x)
    assert_allclose(interpolate(mesh.cells, cell, shape, mesh.points), x, atol=1e-12)


def test_number_of_threads_changes_nothing(mesh, with_one_and_two_threads):
    q = voxel_points(mesh, SHAPE)
    field = np.random.default_rng(2417).standard_normal(mesh.points.shape)
    assert_array_equal(
        *with_one_and_two_threads(lambda: interpolate(mesh.cells, q.cell, q.shape, field))
    )


@pytest.mark.parametrize("most", [400, 70, 1])
def test_fewer_points_weigh_what_all_do(mesh, most):
    whole = gauss_points(mesh)
    some = thinned(whole, most)
    assert len(some) == pytest.approx(most, rel=0.3)
    assert some.weight.sum() == pytest.approx(whole.weight.sum())
    assert set(map(tuple, some.points)) <= set(map(tuple, whole.points))
