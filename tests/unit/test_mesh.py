"""Meshes: volumes, gradients, boundary, pieces, the checks they must pass, and files."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from addvc.errors import MeshError
from addvc.fem.io import read_mesh, read_vtu, write_mesh
from addvc.fem.mesh import (
    Mesh,
    boundary_faces,
    cell_volumes,
    check_mesh,
    dihedral_range,
    face_components,
    inverted_share,
    mean_edge_length,
    oriented,
    physical_gradients,
    submesh,
)
from addvc.geometry.grid import hex_grid

LOW, HIGH = np.array([1.0, 2.0, 3.0]), np.array([11.0, 14.0, 12.0])
VOLUME = np.prod(HIGH - LOW)


@pytest.fixture
def tets(box):
    return box(LOW, HIGH, (3, 4, 2), shake=0.15)


@pytest.fixture
def hexes():
    """A grid with uneven lines, its inner nodes moved."""
    shares = np.array([0, 0.3, 0.7, 1])
    mesh = hex_grid([a + (b - a) * shares for a, b in zip(LOW, HIGH, strict=True)])
    inner = np.all((mesh.points > LOW) & (mesh.points < HIGH), axis=1)
    move = np.random.default_rng(2417).uniform(-0.5, 0.5, mesh.points.shape)
    return Mesh(mesh.points + move * inner[:, None], mesh.cells)


@pytest.fixture(params=["tets", "hexes"])
def mesh(request):
    return request.getfixturevalue(request.param)


def test_volumes_add_up(mesh):
    assert cell_volumes(mesh).min() > 0
    assert cell_volumes(mesh).sum() == pytest.approx(VOLUME, rel=1e-12)
    assert physical_gradients(mesh)[1].sum() == pytest.approx(VOLUME, rel=1e-12)


def test_gradient_of_an_affine_field_is_exact(mesh):
    slope = np.random.default_rng(2417).standard_normal((3, 3))
    gradients, _ = physical_gradients(mesh)
    field = mesh.points @ slope.T
    found = np.einsum("eqaj,eai->eqij", gradients, field[mesh.cells])
    assert_allclose(found, np.broadcast_to(slope, found.shape), atol=1e-12)


def test_boundary_is_closed_and_wound_outwards(mesh):
    """Area vectors add up to zero, and the divergence theorem gives the volume."""
    corner = mesh.points[boundary_faces(mesh)]
    if mesh.is_tet:
        area = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]) / 2
    else:
        area = np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1]) / 2
    assert_allclose(area.sum(axis=0), 0, atol=1e-10)
    assert np.sum(area * corner.mean(axis=1)) / 3 == pytest.approx(VOLUME, rel=1e-12)


def test_boundary_touches_no_inner_node(tets):
    on_box = np.any((tets.points == LOW) | (tets.points == HIGH), axis=1)
    assert_array_equal(np.unique(boundary_faces(tets)), np.flatnonzero(on_box))


def test_inverted_tets_are_turned_round(tets):
    cells = tets.cells.copy()
    cells[::3] = cells[::3][:, [1, 0, 2, 3]]
    wrong = Mesh(tets.points, cells)
    assert_array_equal(cell_volumes(wrong) < 0, np.arange(len(cells)) % 3 == 0)
    assert_allclose(cell_volumes(oriented(wrong)), cell_volumes(tets), rtol=1e-12)


def test_dihedral_angles_and_edges_of_known_tets():
    regular = Mesh([[1, 1, 1], [-1, 1, -1], [1, -1, -1], [-1, -1, 1]], [[0, 1, 2, 3]])
    assert_allclose(dihedral_range(oriented(regular)), np.degrees(np.arccos(1 / 3)), rtol=1e-12)
    assert mean_edge_length(regular) == pytest.approx(np.sqrt(8))
    corner = Mesh(np.vstack([np.zeros(3), np.eye(3)]), [[0, 1, 2, 3]])
    smallest, largest = dihedral_range(corner)
    assert_allclose(smallest, np.degrees(np.arccos(1 / np.sqrt(3))))
    assert_allclose(largest, 90)


def two_boxes(box):
    """Two boxes side by side that share no node, the larger one second."""
    a, b = box((0, 0, 0), (4, 4, 4), (2, 2, 2)), box((6, 0, 0), (16, 4, 4), (5, 2, 2))
    return Mesh(np.vstack([a.points, b.points]), np.vstack([a.cells, b.cells + len(a.points)])), a


def test_largest_piece_is_number_zero(box):
    both, small = two_boxes(box)
    label = face_components(both)
    assert_array_equal(label, np.arange(len(both.cells)) < len(small.cells))
    kept = submesh(both, label == 0)
    assert cell_volumes(kept).sum() == pytest.approx(160)
    assert len(kept.points) == len(both.points) - len(small.points)


def test_tets_that_share_an_edge_only_are_two_pieces():
    points = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, -1, 0], [1, 0, -1]]
    mesh = oriented(Mesh(points, [[0, 1, 2, 3], [0, 1, 4, 5]]))
    assert face_components(mesh).max() == 1


def test_figures_of_a_good_mesh(tets):
    figures = check_mesh(tets, "box")
    assert figures["volume"] == pytest.approx(VOLUME)
    assert figures["nodes"] == 60
    assert figures["mean_volume"] * figures["cells"] == pytest.approx(VOLUME)
    assert figures["min_dihedral"] <= figures["min_dihedral_p01"] < figures["max_dihedral"]


def test_check_refuses_an_empty_mesh(tets):
    with pytest.raises(MeshError, match=r"micro: no cells; .* widen it"):
        check_mesh(submesh(tets, np.zeros(len(tets.cells), bool)), "micro")


def test_check_refuses_inverted_cells(tets):
    cells = tets.cells.copy()
    cells[:2] = cells[:2][:, [1, 0, 2, 3]]
    message = rf"micro: 2 of {len(cells)} cells are inverted .*smallest volume -.*above 0\); change"
    with pytest.raises(MeshError, match=message):
        check_mesh(Mesh(tets.points, cells), "micro")


def test_check_refuses_loose_pieces(box):
    with pytest.raises(MeshError, match=r"micro: 1 pieces are not attached.*limit 0\); keep"):
        check_mesh(two_boxes(box)[0], "micro")


def test_check_refuses_flat_tets(tets):
    with pytest.raises(MeshError, match=r"dihedral angle below 80 degrees \(smallest .*lower"):
        check_mesh(tets, "micro", min_dihedral=80)


def test_cells_must_have_four_or_eight_corners():
    with pytest.raises(MeshError, match=r"cells of shape \(2, 3\); expected \(m, 4\) or \(m, 8\)"):
        Mesh(np.zeros((4, 3)), np.zeros((2, 3)))


def test_files_keep_mesh_and_fields(mesh, tmp_path):
    rng = np.random.default_rng(2417)
    u, strain = rng.standard_normal((len(mesh.points), 3)), rng.random(len(mesh.cells))
    path = tmp_path / "new" / "meso.vtu"
    write_mesh(path, mesh, {"displacement": u}, {"strain": strain})
    back = read_mesh(path)
    assert_array_equal(back.points, mesh.points)
    assert_array_equal(back.cells, mesh.cells)
    _, _, on_points, on_cells = read_vtu(path)
    assert_array_equal(on_points["displacement"], u)
    assert_array_equal(on_cells["strain"], strain)
    assert [file.name for file in path.parent.iterdir()] == ["meso.vtu"]


def test_cells_that_a_displacement_turns_inside_out_are_counted(tets):
    mirror = tets.points * [-2, 0, 0]
    assert inverted_share(tets, 0 * mirror) == inverted_share(tets, tets.points) == 0
    assert inverted_share(tets, mirror) == 1
