"""Rotations of cells, and the elastic energy in the frame that turns with them."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from addvc.fem.mesh import Mesh, cell_volumes
from addvc.fem.operators import corotational_load, lame, stiffness
from addvc.fem.rotations import (
    angles,
    deformation_gradient,
    nearest_rotation,
    smooth_rotations,
)
from addvc.geometry.stuffing import stuff

NU = 0.28


@pytest.fixture(scope="module")
def rod():
    """Tetrahedra of a rod of radius 3, 20 voxels long."""
    i, j, _ = np.indices((14, 14, 20))
    grey = (50 - 20 * (np.hypot(i - 6.5, j - 6.5) - 3)).clip(0, 100).astype(np.float32)
    return stuff(grey, 50.0, 2.0)


def turn(mesh, vector, shift=(3.0, -2.0, 5.0)):
    """u of a rigid motion, and its rotation."""
    rotation = Rotation.from_rotvec(vector).as_matrix()
    return mesh.points @ rotation.T - mesh.points + shift, rotation


def test_nearest_rotation_of_a_stretched_one():
    turns = Rotation.random(50, random_state=2417).as_matrix()
    stretch = np.diag([1.3, 0.8, 1.1])
    np.testing.assert_allclose(nearest_rotation(turns @ stretch), turns, atol=1e-12)


def test_nearest_rotation_of_an_inverted_cell_is_a_rotation():
    turns = Rotation.random(20, random_state=2417).as_matrix()
    flipped = turns @ np.diag([1.0, 0.9, -0.2])
    found = nearest_rotation(flipped)
    np.testing.assert_allclose(np.linalg.det(found), 1, atol=1e-12)
    np.testing.assert_allclose(found, turns, atol=1e-12)  # the least axis is the one given up


def test_a_rigid_turn_is_found(rod):
    u, rotation = turn(rod, [0.9, -1.4, 0.5])
    np.testing.assert_allclose(
        smooth_rotations(rod, u) - rotation, np.zeros((len(rod.cells), 3, 3)), atol=1e-10
    )
    np.testing.assert_allclose(
        angles(smooth_rotations(rod, u)), np.linalg.norm([0.9, -1.4, 0.5]), atol=1e-9
    )


def test_a_bent_rod_turns_along_its_length(rod):
    """u_x = z^2 / 2R: the section at z turns by z / R."""
    radius, z = 200.0, rod.points[:, 2]
    u = np.zeros_like(rod.points)
    u[:, 0], u[:, 2] = z**2 / (2 * radius), -rod.points[:, 0] * z / radius
    middle = rod.points[rod.cells].mean(axis=1)[:, 2]
    inner = (middle > 6) & (middle < 13)  # the average is one-sided at the ends
    found = angles(smooth_rotations(rod, u))[inner]
    np.testing.assert_allclose(found, middle[inner] / radius, atol=2.5 / radius)


def test_forces_vanish_in_a_rigid_motion(rod):
    u, rotation = turn(rod, [0.4, 1.1, -0.8])
    turns = np.broadcast_to(rotation, (len(rod.cells), 3, 3))
    force = stiffness(rod, NU, rotation=turns) @ u.ravel() + corotational_load(rod, NU, turns)
    size = np.abs(stiffness(rod, NU).diagonal()).max()
    assert np.abs(force).max() < 1e-10 * size


def test_without_rotation_the_frame_is_the_fixed_one(rod):
    still = np.broadcast_to(np.eye(3), (len(rod.cells), 3, 3))
    np.testing.assert_allclose(corotational_load(rod, NU, still), 0, atol=1e-14)
    difference = stiffness(rod, NU, rotation=still) - stiffness(rod, NU)
    assert abs(difference).max() < 1e-12


def test_forces_are_the_gradient_of_the_energy(rod):
    """Taylor: E(u + t v) - E(u) - t f.v falls as t^2, the rotations frozen."""
    rng = np.random.default_rng(2417)
    u, rotation = turn(rod, [0.4, 1.1, -0.8])
    u += 0.1 * rng.normal(size=u.shape)
    turns = np.broadcast_to(rotation, (len(rod.cells), 3, 3)) @ nearest_rotation(
        np.eye(3) + 0.1 * rng.normal(size=(len(rod.cells), 3, 3))
    )
    force = stiffness(rod, NU, rotation=turns) @ u.ravel() + corotational_load(rod, NU, turns)
    v = rng.normal(size=u.shape)
    steps = np.array([1e-2, 1e-3, 1e-4])
    rest = [
        abs(energy(rod, u + t * v, turns) - energy(rod, u, turns) - t * force @ v.ravel())
        for t in steps
    ]
    slope = np.polyfit(np.log(steps), np.log(rest), 1)[0]
    assert slope == pytest.approx(2, abs=0.05)


def energy(mesh: Mesh, u, rotation):
    """Integral of (lam tr(e)^2 + 2 mu e:e) / 2 with e = sym(R^T F) - 1."""
    lam, mu = lame(NU)
    strain = np.einsum("eki,ekj->eij", rotation, deformation_gradient(mesh, u))
    strain = (strain + strain.transpose(0, 2, 1)) / 2 - np.eye(3)
    trace = np.einsum("eii->e", strain)
    density = lam * trace**2 / 2 + mu * np.einsum("eij,eij->e", strain, strain)
    return float(cell_volumes(mesh) @ density)
