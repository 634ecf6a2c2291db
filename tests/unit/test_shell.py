"""The shell of void voxels around a mesh."""

import numpy as np
import pytest

from addvc.fem.mesh import Mesh
from addvc.fem.quadrature import gauss_points, interpolate, voxel_points
from addvc.fem.shell import (
    joined,
    load_quadrature,
    nearest_on_triangle,
    save_quadrature,
    shell_points,
)
from addvc.geometry.stuffing import stuff


@pytest.fixture(scope="module")
def rod():
    """A rod of radius 3 along z in 24 x 24 x 20 voxels: grey levels and mesh."""
    i, j, _ = np.indices((24, 24, 20))
    away = np.hypot(i - 11.5, j - 11.5)
    grey = (50 - 20 * (away - 3)).clip(0, 100).astype(np.float32)
    return grey, stuff(grey, 50.0, 1.5)


def test_shell_and_voxels_inside_do_not_overlap(rod):
    grey, mesh = rod
    shell = shell_points(mesh, grey, 50.0)
    inside = {tuple(p) for p in voxel_points(mesh, grey.shape).points.astype(int)}
    around = {tuple(p) for p in shell.points.astype(int)}
    assert len(around) == len(shell) > 100
    assert not inside & around


def test_points_are_void_and_within_the_width(rod):
    grey, mesh = rod
    for width in (0.7, 1.5):
        points = shell_points(mesh, grey, 50.0, width).points
        away = np.hypot(*(points[:, :2] - 11.5).T)
        assert (grey[tuple(points.astype(int).T)] < 50).all()
        assert away.max() < 3 + width + 0.2  # the mesh is a polygon: inside of the circle at most
    assert len(shell_points(mesh, grey, 50.0, 0.7)) < len(points)


def test_solid_that_the_mesh_leaves_out_is_no_shell(rod):
    grey, mesh = rod
    half = grey.copy()
    half[12:] = 80.0  # a platen against one side of the rod
    points = shell_points(mesh, half, 50.0).points
    assert (points[:, 0] < 12).all()
    assert len(points) > 50


def test_the_displacement_is_carried_out_exactly_where_it_is_affine(rod):
    grey, mesh = rod
    shell = shell_points(mesh, grey, 50.0)
    gradient = np.random.default_rng(2417).normal(size=(3, 3))
    carried = interpolate(mesh.cells, shell.cell, shell.shape, mesh.points @ gradient)
    miss = np.linalg.norm(carried - shell.points @ gradient, axis=1)
    extrapolated = np.abs(shell.shape).max(axis=1) > 1
    assert extrapolated.mean() > 0.5
    assert miss[extrapolated].max() < 1e-9
    assert np.abs(shell.shape).max() <= 3


def test_shape_functions_add_up_to_one(rod):
    grey, mesh = rod
    np.testing.assert_allclose(shell_points(mesh, grey, 50.0).shape.sum(axis=1), 1, atol=1e-12)


def test_no_void_no_shell(rod):
    grey, mesh = rod
    shell = shell_points(mesh, np.full_like(grey, 90), 50.0)
    assert len(shell) == 0
    assert len(joined(gauss_points(mesh), shell)) == 4 * len(mesh.cells)


def test_nearest_on_triangle_against_a_search():
    rng = np.random.default_rng(2417)
    share = rng.dirichlet(np.ones(3), 40000)
    for _ in range(20):
        a, b, c, p = rng.normal(size=(4, 3))
        found = np.linalg.norm(p - nearest_on_triangle(p, a, b, c))
        tried = np.linalg.norm(p - share @ np.array([a, b, c]), axis=1).min()
        assert found <= tried + 1e-12
        assert found > tried - 0.05


def test_stored_and_read(tmp_path, rod):
    grey, mesh = rod
    shell = shell_points(mesh, grey, 50.0)
    save_quadrature(tmp_path / "shell.h5", shell)
    back = load_quadrature(tmp_path / "shell.h5")
    for name in ("cell", "shape", "points", "weight"):
        np.testing.assert_array_equal(getattr(back, name), getattr(shell, name))


def test_a_single_tetrahedron_carries_its_surroundings():
    mesh = Mesh(np.array([[4, 4, 4], [8, 4, 4], [4, 8, 4], [4, 4, 8]]) + 0.25, [[0, 1, 2, 3]])
    shell = shell_points(mesh, np.zeros((14, 14, 14), np.float32), 1.0)
    assert set(shell.cell) == {0}
