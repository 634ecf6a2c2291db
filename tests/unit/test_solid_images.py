"""The images of the solid twin: occupancy of deformed elements, inverse of their map, grey levels."""

import numpy as np
import pytest

from addvc.fem.elements import gauss_tet, tet_p2
from addvc.fem.mesh import Mesh
from solid_twin.imaging import Imaging, correlated_noise, eight_bit, platen_share
from solid_twin.raster import locate_grid, occupancy
from solid_twin.solid import Solid, Tetrahedra, quadratic


@pytest.fixture(scope="module")
def mesh(box):
    return quadratic(box((3, 3, 3), (9, 13, 9), (3, 5, 3), shake=0.2))


@pytest.fixture(scope="module")
def bent(mesh):
    """Curved elements: the map is quadratic and the strains some 20 %."""
    x = mesh.points
    wave = np.column_stack([0.03 * (x[:, 1] - 8) ** 2, 0.1 * x[:, 0], x[:, 2] * x[:, 1] / 50])
    return x + wave


def volume(mesh, x):
    """Volume of the deformed solid: det F at the points of a rule, exact to its degree."""
    solid, slopes = Solid(mesh), tet_p2(gauss_tet(4)[0])[1]
    gradients = np.einsum("qaj,ejk->eqak", slopes, solid._inverse)
    det = np.linalg.det(np.einsum("eai,eqaj->eqij", x[mesh.cells], gradients))
    return float((det.mean(axis=1) * solid.volume).sum())


def test_a_box_between_voxels_fills_them_by_its_share(mesh):
    shape = (13, 17, 13)
    share, twice = occupancy(mesh, mesh.points + 0.25, shape, 4)
    edge = [np.clip(np.minimum(np.arange(n) + 0.5, b) - np.maximum(np.arange(n) - 0.5, a), 0, 1)
            for n, a, b in zip(shape, (3.25, 3.25, 3.25), (9.25, 13.25, 9.25), strict=True)]  # fmt: skip
    np.testing.assert_allclose(share, np.einsum("i,j,k->ijk", *edge), atol=1e-6)
    assert twice == 0


def test_the_volume_of_curved_elements_is_found(mesh, bent):
    share, twice = occupancy(mesh, bent, (18, 20, 18), 3)
    assert share.sum() == pytest.approx(volume(mesh, bent), rel=0.01)
    assert volume(mesh, bent) > 1.1 * volume(mesh, mesh.points)
    assert twice < 1e-3


def test_the_material_point_of_a_grid_point_moves_to_it(mesh, bent):
    owner, local, _ = locate_grid(mesh, bent, (18, 20, 18), with_local=True)
    at = np.argwhere(owner >= 0)
    shape = tet_p2(local[:, *at.T].T.astype(float))[0]
    moved = np.einsum("qa,qai->qi", shape, bent[mesh.cells[owner[tuple(at.T)]]])
    assert len(at) > 300
    np.testing.assert_allclose(moved, at, atol=2e-5)


def test_a_margin_adds_points_around_the_solid_only(mesh, bent):
    inner, outer = (locate_grid(mesh, bent, (18, 20, 18), margin=m)[0] for m in (0, 0.3))
    np.testing.assert_array_equal(outer[inner >= 0], inner[inner >= 0])
    assert 1.2 * (inner >= 0).sum() < (outer >= 0).sum() < 3 * (inner >= 0).sum()


def test_what_is_there_twice_is_counted(mesh):
    """Two boxes, one moved by half its width."""
    n = len(mesh.points)
    both = Tetrahedra(np.vstack([mesh.points] * 2), np.vstack([mesh.cells, mesh.cells + n]))
    x = both.points.copy()
    x[n:, 0] += 3
    _, twice = occupancy(both, x, (16, 17, 13), 2)
    assert twice == pytest.approx(1 / 3, rel=0.05)


def test_layers_of_platens():
    share = platen_share(10, (2.2, 7.0))
    np.testing.assert_allclose(share, [1, 1, 0.7, 0, 0, 0, 0, 0.5, 1, 1])


def test_noise_has_its_deviation_and_its_own_field_in_every_state():
    imaging = Imaging(noise=3.0)
    one, two = (correlated_noise((40, 40, 40), imaging, state) for state in (1, 2))
    assert one.std() == pytest.approx(3)
    assert abs(np.corrcoef(one.ravel(), two.ravel())[0, 1]) < 0.02
    np.testing.assert_array_equal(one, correlated_noise((40, 40, 40), imaging, 1))


def test_grey_levels_are_clipped_to_eight_bits():
    np.testing.assert_array_equal(eight_bit(np.array([-3.0, 2.6, 300])), [0, 3, 255])


def test_the_linear_tetrahedra_are_those_of_the_corners(mesh):
    assert isinstance(mesh.linear, Mesh)
    np.testing.assert_array_equal(mesh.linear.cells, mesh.cells[:, :4])
