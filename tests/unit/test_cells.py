"""Strain of cells: exact on affine fields, blind to rotations; bands of known tilt, width and share."""

import numpy as np
import pytest
from matplotlib.figure import Figure
from scipy.spatial.transform import Rotation

from addvc.analysis.cell_strain import cell_strain, columns, described, window
from addvc.analysis.localisation import LEAST_STRAIN, compared, localisation
from addvc.fem.mesh import cell_volumes, nodal_volumes
from addvc.report.cells import across, draw_map, grid_of, profile

CELL = 10.0
EVERY = np.array([[-0.12, 0.03, 0.01], [0.02, -0.21, 0.05], [0.0, -0.04, 0.02]])


@pytest.fixture(scope="module")
def cloud(box):
    return box((0, 0, 0), (30, 35, 30), (12, 14, 12), shake=0.1)


def found(mesh, u, valid=None):
    valid = np.ones(len(u)) if valid is None else valid
    return cell_strain(mesh.points, u, nodal_volumes(mesh), valid, CELL)


def inside(strain, values):
    return values[np.isfinite(strain.gradient[..., 0, 0])]


# ------------------------------------------------------------------------------------- strain


def test_volumes_of_nodes_are_those_of_the_cells(cloud):
    assert nodal_volumes(cloud).sum() == pytest.approx(cell_volumes(cloud).sum())


def test_the_window_is_a_cell_wide_at_half_of_its_height():
    away = np.column_stack([np.linspace(0, 1.2 * CELL, 1201), *np.zeros((2, 1201))])
    w = window(away, CELL)
    assert w[0] == 1 and (np.diff(w) <= 0).all() and w[away[:, 0] >= CELL].max() == 0
    assert 2 * away[w >= 0.5, 0].max() == pytest.approx(1.08 * CELL, rel=0.01)


def test_an_affine_field_is_found_exactly(cloud):
    strain = found(cloud, cloud.points @ EVERY.T + [3, -2, 1])
    known = inside(strain, strain.gradient)
    assert len(known) > 100
    assert np.allclose(known, EVERY, atol=1e-10)
    f = np.eye(3) + EVERY
    assert np.allclose(inside(strain, strain.green_lagrange), (f.T @ f - np.eye(3)) / 2)
    assert np.allclose(inside(strain, strain.volume_ratio), np.linalg.det(f))
    for axis in range(3):
        assert np.allclose(inside(strain, strain.along(axis)), np.linalg.norm(f[:, axis]) - 1)


def test_a_rotation_is_no_strain(cloud):
    turn = Rotation.from_rotvec([0.4, -0.9, 0.3]).as_matrix()
    strain = found(cloud, cloud.points @ (turn - np.eye(3)).T)
    assert np.abs(inside(strain, strain.green_lagrange)).max() < 1e-10
    assert np.abs(inside(strain, strain.along(1))).max() < 1e-10


def test_nodes_that_are_not_valid_are_left_out(cloud, rng):
    valid = rng.random(len(cloud.points)) > 0.2
    u = cloud.points @ EVERY.T
    u[~valid] += 50
    known = inside(found(cloud, u, valid), found(cloud, u, valid).gradient)
    assert len(known) > 100 and np.allclose(known, EVERY, atol=1e-10)
    assert np.isnan(found(cloud, u, np.zeros(len(u))).gradient).all()


def test_beyond_the_specimen_and_of_a_plane_nothing_is_known(cloud):
    flat = cloud.points * [1, 0, 1]
    strain = cell_strain(flat, flat @ EVERY.T, np.ones(len(flat)), np.ones(len(flat)), CELL)
    assert np.isnan(strain.gradient).all()
    kept = cloud.points[(cloud.points[:, [0, 2]] < 15).any(axis=1)]  # a corner is missing
    strain = cell_strain(kept, kept @ EVERY.T, np.ones(len(kept)), np.ones(len(kept)), CELL)
    known = np.isfinite(strain.gradient[..., 0, 0])
    missing = (strain.points[..., [0, 2]] > 17).all(axis=-1)
    assert not known[missing].any() and missing.sum() > 50
    assert known[(strain.points[..., [0, 2]] < 10).any(axis=-1)].mean() > 0.5


def test_the_table_has_a_row_a_point(cloud):
    strain = found(cloud, cloud.points @ EVERY.T)
    table = columns(strain, 1)
    assert list(described()) == list(table)
    lines, axial = grid_of(table)
    assert np.array_equal(axial, strain.along(1), equal_nan=True)
    assert np.allclose(lines[0], strain.points[:, 0, 0, 0])
    known = np.isfinite(table["e_xy"])
    f = np.eye(3) + EVERY
    assert np.allclose(table["e_xy"][known], (f.T @ f)[0, 1] / 2)
    place, mean = profile(lines, axial, 1)
    assert len(place) == axial.shape[1]
    assert np.nanmax(np.abs(mean - 100 * (np.linalg.norm(f[:, 1]) - 1))) < 1e-8


# -------------------------------------------------------------------------------------- bands


def slab(tilt, width, outside=-0.05, within=-0.2, turn=0.0):
    """Grid (31, 41, 31) of spacing 2 and a strain that is larger in a slab through the middle whose
    normal is `tilt` degrees from y, towards x turned by `turn` degrees."""
    points = 2.0 * np.moveaxis(np.indices((31, 41, 31)), 0, -1)
    a, b = np.radians([tilt, turn])
    normal = np.array([np.sin(a) * np.cos(b), np.cos(a), np.sin(a) * np.sin(b)])
    distance = (points - [30, 40, 30]) @ normal
    return points, np.where(np.abs(distance) < width / 2, within, outside), normal


@pytest.mark.parametrize("tilt", [0, 20, 35])
@pytest.mark.parametrize("turn", [0, 50])
def test_a_slab_has_its_tilt_thickness_and_shares(tilt, turn):
    points, strain, normal = slab(tilt, 13.0, turn=turn)
    band = localisation(points, strain, 1, CELL)
    share = (strain == -0.2).mean()
    assert band["bands"] == 1
    assert band["angle"] == pytest.approx(tilt, abs=1)
    assert np.allclose(band["normal"], normal, atol=0.02)
    assert np.allclose(band["centre"], [30, 40, 30], atol=0.5)
    assert band["thickness"] == pytest.approx(13, rel=0.1)
    assert band["volume_share"] == pytest.approx(share)
    assert band["strain_share"] == pytest.approx(share * -0.2 / strain.mean())
    assert band["flatness"] < 0.3


def test_tension_has_bands_too_and_noise_has_none(rng):
    points, strain, _ = slab(20, 12.0)
    assert localisation(points, -strain, 1, CELL)["angle"] == pytest.approx(20, abs=1)
    noise = localisation(points, 0.5 * LEAST_STRAIN * rng.normal(size=strain.shape), 1, CELL)
    assert noise["bands"] is None and noise["normal"] is None
    even = localisation(points, np.full(strain.shape, -0.1), 1, CELL)
    assert even["bands"] == 0 and even["volume_share"] == 0 and even["angle"] is None
    assert localisation(points, np.full(strain.shape, np.nan), 1, CELL)["points"] == 0


def test_of_two_bands_the_larger_is_described():
    points, strain, _ = slab(0, 12.0)
    strain[:, :3] = -0.2
    band = localisation(points, strain, 1, CELL)
    assert band["bands"] == 2 and band["centre"][1] == pytest.approx(40, abs=0.5)
    assert band["band_volume_share"] < band["volume_share"]


def test_the_last_layer_of_points_is_no_band():
    """A band that a face of the region cuts: it is blurred by a cell, so that it cannot be as thin."""
    points, strain, _ = slab(0, 0.0)
    strain[:, :2] = -0.2
    band = localisation(points, strain, 1, CELL)
    assert band["bands"] == 0 and band["normal"] is None and band["volume_share"] > 0.04


def test_a_slab_too_thin_for_a_cell_says_so():
    """One layer of points, nothing known: a map with a height, and words."""
    points, strain, _ = slab(0, 8.0)
    nothing = localisation(points[:, :1], np.full_like(strain[:, :1], np.nan), 1, CELL)
    assert nothing["mean_strain"] is None and nothing["points"] == 0
    ax = Figure().add_subplot()
    draw_map(ax, np.full((1, 14), np.nan), np.arange(14.0), np.array([5.0]))
    assert ax.get_ylim() == (4.0, 6.0)
    assert "thinner than a cell" in ax.texts[0].get_text()


def test_a_lump_is_not_flat():
    points = slab(0, 12.0)[0]
    ball = np.linalg.norm(points - [30, 40, 30], axis=-1) < 12
    band = localisation(points, np.where(ball, -0.2, -0.05), 1, CELL)
    assert band["flatness"] == pytest.approx(1, abs=0.1)


def test_a_band_is_compared_with_the_true_one():
    points, strain, _ = slab(20, 12.0)
    _, true, _ = slab(25, 12.0)
    found, other = (localisation(points, s, 1, CELL) for s in (strain, true))
    assert compared(found, other, strain, true)["angle_between_normals"] == pytest.approx(5, abs=1)
    same = compared(found, found, strain.ravel(), strain.ravel())
    assert same["strain_rms_difference"] == 0 and same["strain_correlation"] == pytest.approx(1)
    none = localisation(points, np.zeros(strain.shape), 1, CELL)
    assert compared(none, other, strain, true)["angle_between_normals"] is None


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_bands_are_seen_from_where_their_tilt_shows(axis):
    first, second = (d for d in range(3) if d != axis)
    normal = np.eye(3)[axis] + 0.4 * np.eye(3)[first]
    assert across(axis, [normal.tolist(), None]) == second
    assert across(axis, [None]) == first
