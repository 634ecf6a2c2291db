"""The carried solid against the deformed image, on balls and slabs whose motion is known."""

import numpy as np
import pytest

from addvc.analysis.overlap import (
    CarriedRegion,
    dice,
    level_set,
    overlap,
    solid_voxels,
    surface_distance,
)
from addvc.fem.mesh import Mesh, boundary_faces
from addvc.geometry.region import Region

SHAPE = (41, 44, 47)
WHOLE = Region(1, -5.0, 60.0, (20.0, 23.0), 60.0)
MIDDLE = np.array([20, 22, 23])
SHIFT = np.array([2.0, -3.0, 4.0])


def ball(centre, radius):
    """Grey levels of a ball whose surface is the level 0."""
    grid = np.stack(np.meshgrid(*map(np.arange, SHAPE), indexing="ij"), axis=-1)
    return (radius - np.linalg.norm(grid - centre, axis=-1)).astype(np.float32)


@pytest.fixture(scope="module")
def solid(box):
    """A ball of radius 10 about (20, 22, 23), of tetrahedra."""
    cube = box([-1] * 3, [1] * 3, (14, 14, 14))
    length = np.linalg.norm(cube.points, axis=1, keepdims=True)
    largest = np.abs(cube.points).max(axis=1, keepdims=True)
    round_ = 10 * cube.points * largest / np.maximum(length, 1e-12)
    return Mesh(round_ + MIDDLE, cube.cells)


def test_a_box_holds_the_voxels_between_its_faces(box):
    found = solid_voxels(box([2.5, 3.5, 4.5], [7.5, 9.5, 12.5], (2, 3, 4)), (12, 12, 16))
    true = np.zeros((12, 12, 16), bool)
    true[3:8, 4:10, 5:13] = True
    assert (found == true).all()


def test_cells_turned_inside_out_and_flat_ones_are_borne(box):
    mesh = box([2.5] * 3, [7.5] * 3, (1, 1, 1))
    flat = Mesh(mesh.points, np.vstack([mesh.cells[:, [1, 0, 2, 3]], [[0, 1, 0, 1]]]))
    assert (solid_voxels(flat, (9, 9, 9)) == solid_voxels(mesh, (9, 9, 9))).all()


@pytest.mark.parametrize("shift", [np.zeros(3), SHIFT])
def test_the_right_displacement_covers_the_image(solid, shift):
    u = np.broadcast_to(shift, solid.points.shape)
    found = overlap(solid, u, ball(MIDDLE + shift, 10), 0.0, WHOLE)
    assert found["dice"] > 0.98 and found["distance_p95"] < 0.05
    assert found["missed"] == 0 and found["outside"] == 0


def test_a_shift_that_is_not_undone_has_the_overlap_of_two_balls(solid):
    """Their lens is 1 - 3 d / 4 R + d^3 / 16 R^3 of a ball; the surfaces are up to d apart."""
    d = 4.0
    found = overlap(solid, 0 * solid.points, ball([20, 22 + d, 23], 10), 0.0, WHOLE)
    assert found["dice"] == pytest.approx(1 - 3 * d / 40 + d**3 / 16e3, abs=0.01)
    assert found["distance_p95"] == pytest.approx(0.95 * d, rel=0.05)
    assert found["distance_median"] == pytest.approx(0.5 * d, rel=0.1)
    assert found["missed"] == pytest.approx(1 - 1 / d, abs=0.03)


def test_the_level_set_is_of_second_order_in_the_voxel():
    """Of the level set from the true sphere, on a voxel and on half a voxel."""
    worst = []
    for radius in (5.0, 10.0):
        centre = np.array([20.3, 21.6, 23.1])
        points, _ = level_set(ball(centre, radius), 0.0)
        gap = np.abs(np.linalg.norm(points - centre, axis=1) - radius)
        worst.append(gap.max() / radius)  # in units of the ball
    assert worst[1] < worst[0] / 3.5


def test_distance_is_to_the_triangle_not_to_its_corners(box):
    mesh = box([0] * 3, [30, 30, 30], (1, 1, 1))
    query = np.array([[15.0, 15.0, 33.0], [15.0, -2.0, 7.0], [33.0, 34.0, 15.0]])
    found = surface_distance(query, mesh.points, boundary_faces(mesh))
    assert found == pytest.approx([3, 2, 5])


def test_what_has_left_the_image_is_not_counted(solid):
    u = np.zeros_like(solid.points)
    u[:, 2] = 23.0  # the middle of the ball is now in the last plane of voxels
    found = overlap(solid, u, ball([20, 22, 46], 10), 0.0, WHOLE)
    assert found["dice"] > 0.97 and found["distance_p95"] < 0.06
    assert 0.4 < found["outside"] < 0.6


def test_solid_beyond_the_carried_caps_is_not_missed(box):
    """A column between platens that come 4 voxels nearer, cut by the caps of the region."""
    mesh = box([15.5, 10.0, 17.5], [25.5, 30.0, 27.5], (5, 10, 5))
    u = np.zeros_like(mesh.points)
    u[:, 1] = -0.2 * (mesh.points[:, 1] - 10)
    image = np.full(SHAPE, -1.0, np.float32)
    image[16:26, :, 18:28] = 1.0
    image[:, :8] = image[:, 28:] = 1.0
    found = overlap(mesh, u, image, 0.0, Region(1, 10.0, 30.0, (20.0, 22.0), 60.0))
    assert found["dice"] > 0.99 and found["missed"] == 0


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_caps_are_carried_by_the_nodes_on_them(box, axis):
    mesh = box([0] * 3, [10] * 3, (4, 4, 4))
    u = np.zeros_like(mesh.points)
    u[:, axis] = 1 + 0.3 * mesh.points[:, axis]
    region = Region(axis, 0.0, 10.0, bounds=((-1, 11), (-1, 11)), cut_sides=True)
    limits = CarriedRegion(mesh.points, u, np.unique(boundary_faces(mesh)), region)
    query = np.full((4, 3), 5.0)
    query[:, axis] = [0.0, 1.5, 13.0, 15.0]
    assert limits.depth(query) == pytest.approx([-1, 0.5, 1, -1])


def test_nothing_in_the_image_is_told_from_nothing_known(solid):
    found = overlap(solid, 0 * solid.points, np.zeros(SHAPE, np.float32), 1.0, WHOLE)
    assert found["dice"] == 0
    assert np.isnan(found["distance_median"]) and np.isnan(found["missed"])
    assert np.isnan(dice(np.zeros(3, bool), np.zeros(3, bool)))
