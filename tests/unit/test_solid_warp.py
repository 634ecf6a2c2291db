"""The warp of a real image by the motion of its solid: what is carried, and what is in between."""

import numpy as np
import pytest
from scipy import ndimage

from addvc.analysis.mesh_truth import MeshTruth
from addvc.fem.quadrature import gauss_points
from addvc.images.spline import interpolating_coefficients, spline_value
from solid_twin.bone import compressed, mesh_of
from solid_twin.equilibrium import Options
from solid_twin.raster import locate_grid
from solid_twin.solid import quadratic
from solid_twin.warp import harmonic, pulled_back, warp


def test_harmonic_extension_keeps_what_is_known_and_is_linear_between_planes():
    known = np.zeros((33, 9, 8), bool)
    known[[0, 1, 31, 32]] = True
    exact = np.broadcast_to(np.arange(33, dtype=np.float32)[:, None, None], known.shape)
    found = harmonic(np.where(known, exact, 0), known)
    np.testing.assert_array_equal(found[known], exact[known])
    np.testing.assert_allclose(found, exact, atol=1)


def test_harmonic_extension_has_no_extremes_of_its_own(rng):
    known = rng.random((20, 21, 22)) < 0.05
    values = np.where(known, rng.standard_normal(known.shape), 0).astype(np.float32)
    found = harmonic(values, known)
    assert values[known].min() <= found.min() and found.max() <= values[known].max()


@pytest.fixture(scope="module")
def block(box):
    return quadratic(box((4, 4, 4), (20, 26, 20), (4, 6, 4)))


def test_the_inverse_of_an_affine_motion_is_found(block):
    """Inside and in the margin exactly, in the void by continuity."""
    slope = np.array([[0.05, 0.1, 0], [0, -0.1, 0.02], [0.03, 0, 0.04]])
    x = block.points + block.points @ slope.T
    v, known, twice = pulled_back(block, x, (26, 28, 26))
    y = np.argwhere(known)
    exact = y - y @ np.linalg.inv(np.eye(3) + slope).T
    np.testing.assert_allclose(v[:, known].T, exact, atol=1e-4)
    assert known.sum() > (locate_grid(block, x, (26, 28, 26))[0] >= 0).sum() > 5000
    assert twice == 0


def test_without_motion_the_image_stays_and_noise_is_as_asked(block, speckle):
    volume = speckle((26, 28, 26)).clip(0, 255).astype(np.uint8)
    same, _ = warp(volume, block, block.points, 0.0, 1)
    np.testing.assert_array_equal(same, volume)
    noisy, _ = warp(volume.astype(np.float32), block, block.points, 3.0, 1)
    assert np.std(noisy - volume) == pytest.approx(3, rel=0.02)


def pillar():
    """Grey levels (26, 32, 26): a leaning pillar with texture between two plates."""
    x, y, z = np.mgrid[:26, :32, :26]
    distance = np.where(abs(y - 15.5) > 12, 0, np.hypot(x - 9 - 0.25 * y, z - 12.5))
    texture = ndimage.gaussian_filter(np.random.default_rng(2417).standard_normal(x.shape), 2)
    grey = 110 * (1 + 1.5 * texture) / (1 + np.exp(distance - 4))
    return ndimage.gaussian_filter(grey, 0.8).astype(np.float32)


def test_a_compressed_scan_agrees_with_its_truth():
    """Pressed by 6 %: the residual under the truth is that of two cubic splines, a small part of
    the residual without motion."""
    volume = pillar()
    mesh, step = compressed(mesh_of(volume, 55.0, 3.5), 0.06, options=Options(increment=0.03))
    moved, twice = warp(volume, mesh, step.x, 0.0, 1)
    truth = MeshTruth(mesh.points, mesh.cells, [step.x - mesh.points])
    at = gauss_points(mesh.linear).points
    one, two = interpolating_coefficients(volume, 3), interpolating_coefficients(moved, 3)
    y = at + truth.displacement(at, 1)
    r, still = (spline_value(one, at, 3)[0] - spline_value(two, p, 3)[0] for p in (y, at))
    inside = ((at > 2) & (at < np.array(volume.shape) - 3)).all(axis=1)
    assert step.force > 0 and twice < 0.01
    assert inside.sum() > 2000
    assert r[inside].std() < 0.1 * still[inside].std()
    assert r[inside].std() < 1.0
