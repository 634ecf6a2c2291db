"""Tetrahedra from the lattice: never inverted, never flat, closed, of the shape asked for."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from scipy import ndimage

from addvc.fem.mesh import boundary_faces, cell_volumes, dihedral_range, face_components
from addvc.geometry.stuffing import stuff
from addvc.geometry.surface import Surface, check_watertight, enclosed_volume

LEAST_ANGLE = 8.0  # degrees
CENTRE = np.array([19.3, 20.1, 19.8])
X = np.moveaxis(np.indices((40, 40, 40)).astype(float), 0, -1) - CENTRE


def sphere(radius=12.4):
    """Level set whose zero is a sphere."""
    return (radius - np.linalg.norm(X, axis=-1)).astype(np.float32)


def torus(large=11.0, small=4.0):
    """Level set whose zero is a torus."""
    ring = np.hypot(X[..., 0], X[..., 1]) - large
    return (small - np.hypot(ring, X[..., 2])).astype(np.float32)


def rod(seed, radius=1.0, half=12.0):
    """Blurred grey levels of a rod in a random direction, as a scan would show it."""
    rng = np.random.default_rng(seed)
    way, start = rng.standard_normal(3), rng.uniform(-1, 1, 3)
    way /= np.linalg.norm(way)
    y = X - start
    distance = np.linalg.norm(y - np.clip(y @ way, -half, half)[..., None] * way, axis=-1)
    grey = 20 + 90 * np.clip(radius + 0.5 - distance, 0, 1)
    return ndimage.gaussian_filter(grey.astype(np.float32), 0.7), np.pi * radius**2 * 2 * half


def assert_sound(mesh):
    """No cell inverted or flat; a boundary that closes and encloses what the cells fill."""
    volumes = cell_volumes(mesh)
    assert volumes.min() > 0
    assert dihedral_range(mesh)[0].min() > LEAST_ANGLE
    surface = Surface(mesh.points, boundary_faces(mesh))
    check_watertight(surface, "stuffed")
    assert enclosed_volume(surface) == pytest.approx(volumes.sum(), rel=1e-9)


@pytest.mark.parametrize("spacing", [1.3, 2.0, 3.1])
@pytest.mark.parametrize("shape", [sphere, torus])
def test_smooth_bodies_give_sound_meshes(shape, spacing):
    mesh = stuff(shape(), 0.0, spacing)
    assert_sound(mesh)
    assert face_components(mesh).max() == 0


@pytest.mark.parametrize("spacing", [1.0, 1.2])
@pytest.mark.parametrize("seed", range(2417, 2425))
def test_thin_rods_in_any_direction_stay_whole(seed, spacing):
    grey, volume = rod(seed)
    mesh = stuff(grey, 50.0, spacing)
    assert_sound(mesh)
    assert face_components(mesh).max() == 0
    assert cell_volumes(mesh).sum() == pytest.approx(volume, rel=0.25)


def test_volume_of_a_sphere_converges_with_order_two():
    spacings = np.array([4.0, 2.0, 1.0])
    exact = 4 / 3 * np.pi * 12.4**3
    errors = [exact - cell_volumes(stuff(sphere(), 0.0, a)).sum() for a in spacings]
    orders = np.diff(np.log(errors)) / np.diff(np.log(spacings))
    print("relative errors", np.divide(errors, exact), "orders", orders)
    assert orders.mean() == pytest.approx(2, abs=0.3)


def test_boundary_lies_on_the_level_set():
    mesh = stuff(sphere(), 0.0, 1.3)
    nodes = mesh.points[np.unique(boundary_faces(mesh))]
    assert np.abs(np.linalg.norm(nodes - CENTRE, axis=1) - 12.4).max() < 0.05


def test_volume_of_a_torus():
    volume = cell_volumes(stuff(torus(), 0.0, 1.0)).sum()
    assert volume == pytest.approx(2 * np.pi**2 * 11 * 16, rel=0.02)


def test_mean_cell_volume_is_that_of_the_lattice():
    """The inside of a body is filled by congruent tetrahedra of a^3 / 12."""
    volumes = cell_volumes(stuff(sphere(), 0.0, 1.3))
    assert np.median(volumes) == pytest.approx(1.3**3 / 12, rel=1e-6)
    assert volumes.mean() == pytest.approx(1.3**3 / 14, rel=0.15)


def test_two_runs_give_the_same_mesh():
    first, second = (stuff(rod(2417)[0], 50.0, 1.2) for _ in range(2))
    assert_array_equal(first.points, second.points)
    assert_array_equal(first.cells, second.cells)


def test_solid_that_touches_the_border_of_the_image_is_closed_there():
    mesh = stuff(sphere(25.0), 0.0, 2.0)
    assert_sound(mesh)
    assert mesh.points.min() == pytest.approx(-0.5, abs=0.1)
    assert mesh.points.max() == pytest.approx(39.5, abs=0.1)


@pytest.mark.parametrize("slope, offset", [(1e-5, 0), (200, -1000)])
def test_the_unit_of_the_grey_level_does_not_matter(slope, offset):
    """Solid that touches the border, and pieces that are dropped, too: attenuations or 16 bits."""
    pieces = np.maximum(sphere(25.0), np.maximum(rod(2417)[0], rod(2418)[0]) - 50)
    meshes = [stuff(a * pieces + np.float32(b), b, 2.0) for a, b in ((1, 0), (slope, offset))]
    np.testing.assert_allclose(*(mesh.points for mesh in meshes), atol=1e-3)


def test_image_without_solid_gives_no_cells():
    assert len(stuff(np.zeros((12, 12, 12), np.float32), 50.0, 2.0).cells) == 0
