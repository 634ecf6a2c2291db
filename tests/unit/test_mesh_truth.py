"""A truth on a mesh of the user's own: interpolation, axes of struts, the file, its errors."""

import h5py
import numpy as np
import pytest

from addvc.analysis.mesh_truth import MeshTruth, is_mesh_truth, save_mesh_truth
from addvc.analysis.truth import check_truth, errors_at, junction_accuracy, load_truth
from addvc.errors import ConfigError, MeshError
from addvc.fem.elements import P2_EDGES, tet_p1, tet_p2
from addvc.fem.mesh import Mesh
from solid_twin.solid import quadratic


def quadratic_field(x):
    """u (n, 3), a polynomial of degree two."""
    return 0.01 * np.column_stack([x[:, 0] * x[:, 1], x[:, 1] ** 2 - x[:, 2], x[:, 2] * x[:, 0]])


@pytest.fixture(scope="module")
def block(box):
    mesh = quadratic(box((2, 2, 2), (8, 10, 8), (4, 5, 4), shake=0.2))
    return MeshTruth(mesh.points, mesh.cells, [quadratic_field(mesh.points)])


@pytest.fixture(scope="module")
def cross():
    """A mesh of three square rods of 2 x 2 x 16 voxels along x, y and z that meet in the middle."""
    centre = np.arange(-7.5, 8)
    grid = np.stack(np.meshgrid(centre, centre, centre, indexing="ij"), -1).reshape(-1, 3)
    cubes = grid[(np.abs(grid) < 1).sum(axis=1) >= 2]
    corners = np.array([[i, j, k] for k in (0, 1) for j in (0, 1) for i in (0, 1)]) - 0.5
    points, number = np.unique(
        (cubes[:, None] + corners).reshape(-1, 3), axis=0, return_inverse=True
    )
    six = [[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]]
    cells = number.reshape(-1, 8)[:, six].reshape(-1, 4)
    return MeshTruth(points, cells, [np.zeros_like(points)])


# --------------------------------------------------------------------------------- elements


def test_quadratic_shape_functions(rng):
    """One at their node, zero at others; sums 1 and 0; exact on quadratics; slopes by Taylor."""
    corner = np.vstack([np.zeros(3), np.eye(3)])
    nodes = np.vstack([corner, corner[P2_EDGES].mean(axis=1)])
    np.testing.assert_allclose(tet_p2(nodes)[0], np.eye(10), atol=1e-15)
    xi = rng.dirichlet(np.ones(4), 20)[:, 1:]
    shape, slope = tet_p2(xi)
    np.testing.assert_allclose(shape.sum(axis=1), 1)
    np.testing.assert_allclose(slope.sum(axis=1), 0, atol=1e-14)
    np.testing.assert_allclose(shape @ quadratic_field(nodes), quadratic_field(xi), atol=1e-15)
    v = rng.standard_normal(3)
    change = (tet_p2(xi + 1e-5 * v)[0] - tet_p2(xi - 1e-5 * v)[0]) / 2e-5
    np.testing.assert_allclose(slope @ v, change, atol=1e-8)


# ----------------------------------------------------------------------------- displacement


def test_displacement_is_exact_on_quadratics_inside_and_just_outside(block, rng):
    inside = rng.uniform([2, 2, 2], [8, 10, 8], (500, 3))
    outside = inside.copy()
    outside[:, 0] = 8 + rng.uniform(0, 1, 500)
    for points in (inside, outside):
        u = block.displacement(points, 1)
        np.testing.assert_allclose(u, quadratic_field(points), atol=1e-10)


def test_linear_tetrahedra_are_exact_on_affine_fields(box, rng):
    mesh = box((0, 0, 0), (4, 4, 4), (3, 3, 3), shake=0.2)
    slope = rng.standard_normal((3, 3))
    truth = MeshTruth(mesh.points, mesh.cells, [mesh.points @ slope.T + 1])
    x = rng.uniform(0, 4, (200, 3))
    np.testing.assert_allclose(truth.displacement(x, 1), x @ slope.T + 1, atol=1e-12)
    assert tet_p1(x)[0].shape == (200, 4)


def test_the_reference_does_not_move(block):
    assert not block.displacement(block.mesh.points, 0).any()
    assert block.strains is None and block.platens is None


@pytest.mark.parametrize("state", [-1, 2])
def test_a_state_that_is_not_there(block, state):
    with pytest.raises(ConfigError, match=rf"no state {state} \(0 to 1\); list as many"):
        block.displacement(block.mesh.points, state)


# ----------------------------------------------------------------------------------- struts


def test_struts_of_a_cross(cross):
    """Six arms that meet in one junction; each has its own axis, and the surface is where it is."""
    arms = 5.5 * np.vstack([np.eye(3), -np.eye(3)]) + 0.1
    index, tangent, distance = cross.strut(arms)
    assert len(np.unique(index)) == 6
    along = np.abs(np.einsum("ni,ni->n", tangent, np.vstack([np.eye(3)] * 2)))
    assert np.degrees(np.arccos(along.clip(-1, 1))).max() < 10
    np.testing.assert_allclose(distance, -0.9, atol=0.15)
    np.testing.assert_allclose(cross.junctions, [[0, 0, 0]], atol=0.1)


def test_distance_to_the_surface_is_positive_outside(cross):
    _, _, distance = cross.strut(np.array([[6.0, 2.0, 0.0], [0.0, 3.0, -6.0]]))
    np.testing.assert_allclose(distance, [1, 2], atol=0.1)


def test_errors_are_split_along_and_across_struts(cross):
    """A slip of 0.3 voxel along an arm, and 0.4 across it."""
    x = np.array([[5.0, 0, 0], [-6.0, 0, 0]])
    (found,) = errors_at(cross, x, [np.array([[0.3, 0.4, 0], [0.3, 0.4, 0]])], 1)
    assert found["rms"] == pytest.approx(0.5)
    assert found["rms_along"] == pytest.approx(0.3, abs=0.05)
    assert found["rms_normal"] == pytest.approx(0.4, abs=0.05)


def test_a_junction_is_as_far_off_as_its_nodes_are_on_the_mean(cross, rng):
    """One junction, in the middle: noise of its nodes averages out, what they share does not."""
    points = rng.uniform(-1.9, 1.9, (500, 3))
    for shift, shares in ((0.8, [1, 1, 1]), (1.5, [0, 1, 1]), (3.0, [0, 0, 1])):
        u = rng.normal([0, shift, 0], 0.5, (500, 3))
        (found,) = errors_at(cross, points, [u], 1)
        assert found["junctions"]["count"] == 1
        assert [found["junctions"][f"within_{limit}"] for limit in (1, 2, 4)] == shares
    far = junction_accuracy(cross.junctions, points + 9, u)
    assert far == {"count": 0, "within_1": None, "within_2": None, "within_4": None}


def test_a_solid_without_struts_has_one_axis_everywhere_and_no_strut_is_lost(block):
    index, tangent, _ = block.strut(block.mesh.points)
    assert index.shape == (len(block.mesh.points),)
    np.testing.assert_allclose(np.linalg.norm(tangent, axis=1), 1)


# --------------------------------------------------------------------------------- the file


def test_what_is_written_is_read(block, tmp_path, rng):
    path = tmp_path / "truth.h5"
    u = block._u[0]
    save_mesh_truth(path, block._points, block._cells, [u, 2 * u], [0.1, 0.2], np.zeros((3, 2)))
    found = load_truth(path)
    assert isinstance(found, MeshTruth) and is_mesh_truth(path)
    assert found.strains == (0.0, 0.1, 0.2) and found.platens.shape == (3, 2)
    x = rng.uniform(2, 8, (50, 3))
    np.testing.assert_allclose(found.displacement(x, 2), 2 * block.displacement(x, 1), atol=1e-12)


def test_a_file_without_what_is_needed(tmp_path):
    path = tmp_path / "truth.h5"
    with h5py.File(path, "w") as file:
        file["points"] = np.zeros((4, 3))
    with pytest.raises(ConfigError, match=r"has no dataset \['cells', 'displacement1'\]; a truth"):
        load_truth(path)
    with h5py.File(path, "w") as file:
        for name in ("points", "cells", "displacement1", "displacement3", "displacement_unit"):
            file[name] = np.zeros((4, 3))
    with pytest.raises(ConfigError, match=r"has no dataset \['displacement2'\]"):
        load_truth(path)
    with h5py.File(path, "w") as file:
        file["cells"], file["displacement1"] = np.zeros((1, 4), int), np.zeros((4, 3))
        file.create_group("points")
    with pytest.raises(ConfigError, match=r"has no dataset \['points'\]"):
        load_truth(path)
    path.write_text("no HDF5")
    with pytest.raises(ConfigError, match="cannot be read as HDF5"):
        load_truth(path)


def test_meshes_that_cannot_be_interpolated_in_are_refused(block):
    points, cells, u = block._points, block._cells, block._u
    with pytest.raises(MeshError, match=r"cells of shape \(\d+, 8\); \(m, 4\) or \(m, 10\)"):
        MeshTruth(points, cells[:, :8], u)
    for some, wrong in (
        (points[:, :2], "points"),
        (points[:0], "points"),
        (points[:, 0], "points"),
    ):
        with pytest.raises(MeshError, match=rf"has {wrong} of shape .*; \(n, 3\) is needed"):
            MeshTruth(some, cells, [some])
    with pytest.raises(MeshError, match=r"has cells of shape \(0, 10\); \(m, 4\) or"):
        MeshTruth(points, cells[:0], u)
    with pytest.raises(
        MeshError, match="cells of the truth are numbers of float64; give whole ones"
    ):
        MeshTruth(points, cells.astype(float), u)
    with pytest.raises(MeshError, match=r"displacement1 of the truth has shape \(\d+, 2\)"):
        MeshTruth(points, cells, [u[0][:, :2]])
    bent = points.copy()
    bent[cells[0, 4]] += [0.2, 0, 0]
    with pytest.raises(MeshError, match=r"0\.2 voxel off the middle \(at most 0\.001\); give"):
        MeshTruth(bent, cells, u)


def test_numbers_that_are_none_and_nodes_that_are_not_there_are_refused(block):
    points, cells, u = block._points, block._cells, block._u
    with pytest.raises(
        MeshError, match=rf"nodes 1 to {len(points)}, its points are 0 to .* from 0"
    ):
        MeshTruth(points, cells + 1, u)
    gaps = u[0].copy()
    gaps[[3, 5], 1] = np.nan
    with pytest.raises(
        MeshError, match=rf"2 of the {len(points)} vectors of displacement1 .* finite"
    ):
        MeshTruth(points, cells, [gaps])


def test_a_truth_in_another_unit_and_flat_cells_are_refused(block, rng):
    x = rng.uniform([2, 2, 2], [8, 10, 8], (200, 3))
    large = MeshTruth(20 * block._points, block._cells, block._u)
    with pytest.raises(MeshError, match=r"measures 120 x 160 x 120, .* voxels of the binned"):
        errors_at(large, x, [0 * x], 1)
    cells = block._cells.copy()
    cells[3] = cells[3, 0]
    with pytest.raises(MeshError, match=rf"1 of {len(cells)} cells of the truth have no volume"):
        MeshTruth(block._points, cells, block._u)


def test_a_truth_that_lies_elsewhere_is_refused(block, rng, caplog):
    """Millimetres, or a crop that was forgotten; a strut that it lacks only makes a warning."""
    x = rng.uniform([2, 2, 2], [8, 10, 8], (100, 3))
    with pytest.raises(
        MeshError, match=r"100% of the nodes .* over 2 voxels outside .* scans.crop"
    ):
        errors_at(block, x + 20, [0 * x], 1)
    errors_at(block, np.where(np.arange(100)[:, None] < 10, x + 20, x), [0 * x], 1)
    assert "10 % of the nodes are over 2 voxels outside" in caplog.text


def test_a_truth_is_checked_before_any_work(block, tmp_path):
    path = tmp_path / "truth.h5"
    save_mesh_truth(path, block._points, block._cells, block._u)
    check_truth(path, 1)
    with pytest.raises(ConfigError, match=r"truth.h5 has 1 states \(at least 2, those of scans"):
        check_truth(path, 2)


def test_orientation_of_the_cells_does_not_matter(cross, rng):
    mirrored = MeshTruth(cross._points, cross._cells[:, [0, 2, 1, 3]], cross._u)
    assert isinstance(mirrored.mesh, Mesh)
    x = rng.uniform([5.1, -0.9, -0.9], [6.9, 0.9, 0.9], (20, 3))
    np.testing.assert_allclose(mirrored.strut(x)[2], cross.strut(x)[2])
