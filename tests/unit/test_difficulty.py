"""The best field of a mesh: exact where the mesh can hold the truth, second order where it cannot."""

from types import SimpleNamespace

import numpy as np
import pytest

from addvc.analysis.difficulty import Best, beyond_affine, difficulty, projections
from addvc.correlation.gauss_newton import rms
from addvc.correlation.micro import micro_reference
from addvc.images.spline import interpolating_coefficients

SEED = 2417
SLOPE = np.array([[0.01, 0.004, 0.0], [-0.003, -0.03, 0.002], [0.0, 0.005, 0.012]])
CENTRE = np.array([20.0, 22.0, 24.0])


def affine(x, state=1):
    return (x - CENTRE) @ SLOPE.T


def wave(x, state=1):
    """A bending that no affine field holds, half a wave in the box."""
    return 0.5 * np.sin(np.pi * x[:, [1, 2, 0]] / 40)


@pytest.fixture(scope="module")
def cloud():
    """Points (Q, 3) with weights (Q,), and nodes (n, 3), within a box of 40 voxels."""
    rng = np.random.default_rng(SEED)
    return rng.uniform(1, 39, (20000, 3)), rng.uniform(0.5, 2, 20000), rng.uniform(1, 39, (500, 3))


@pytest.fixture(scope="module")
def meso(box):
    """meso(count): a mesh of the box, a little larger than what it holds."""
    return lambda count: box((0, 0, 0), (40, 40, 40), (count,) * 3, shake=0.15)


def test_nothing_of_an_affine_field_is_beyond_one(rng):
    x = rng.uniform(0, 40, (300, 3))
    assert beyond_affine(x, affine(x)) < 1e-12
    assert beyond_affine(x, wave(x)) == pytest.approx(beyond_affine(x, wave(x) + affine(x)))
    assert 0.05 < beyond_affine(x, wave(x)) < rms(wave(x))


def test_a_meso_mesh_holds_affine_fields_exactly(cloud, meso):
    points, weight, nodes = cloud
    held, held_nodes = Best.of(meso(2), points, weight, nodes)(affine(points))
    assert np.abs(held - affine(points)).max() < 1e-5  # a Laplacian of 1e-6 beside the mass
    assert rms(held_nodes - affine(nodes)) < 1e-5


def test_the_projection_is_the_best_field_of_its_mesh(cloud, meso):
    """No other field of the mesh is nearer to the truth, its interpolant for one; and its own
    projection is itself."""
    points, weight, nodes = cloud
    mesh = meso(3)
    best = Best.of(mesh, points, weight, nodes)
    held, _ = best(wave(points))

    def far(u):
        return np.average(np.sum((u - wave(points)) ** 2, axis=1), weights=weight)

    assert far(held) < far(best.project.at_points @ wave(mesh.points))
    bump = np.random.default_rng(SEED).standard_normal(mesh.points.shape)
    for size in (1e-2, -1e-2):
        assert far(held) < far(held + size * best.project.at_points @ bump)
    assert best(held)[0] == pytest.approx(held, abs=1e-4)


def test_what_a_mesh_cannot_hold_falls_with_the_square_of_its_size(cloud, meso):
    points, weight, nodes = cloud
    left = [
        rms(Best.of(meso(count), points, weight, nodes)(wave(points))[1] - wave(nodes))
        for count in (2, 4, 8)
    ]
    orders = np.log2(left[:-1]) - np.log2(left[1:])
    print("rms beyond the best field", left, "orders", orders)
    assert (orders > 1.6).all() and (orders < 3).all()


# ---------------------------------------------------------------------------- of whole states


@pytest.fixture(scope="module")
def state(stretched, box):
    """Reference at the Gauss points of a fine mesh, I_d of the affine field, meso meshes, nodes."""
    shape = (41, 45, 49)
    images = stretched(shape, SLOPE, CENTRE)
    fine = box((6, 6, 6), (34, 38, 42), (9, 10, 11))
    reference, deformed = (interpolating_coefficients(image) for image in images)
    meshes = {f"meso{n}": box((4, 4, 4), (36, 40, 44), (count,) * 3)
              for n, count in ((32, 1), (16, 2))}  # fmt: skip
    return micro_reference(fine, reference), deformed, meshes, fine.points


def judged(state, truth):
    reference, deformed, meshes, nodes = state
    best = projections(reference, nodes, meshes)
    return difficulty(truth, reference, deformed, 1, nodes, best)


def test_an_affine_state_is_no_test_of_any_mesh(state):
    found = judged(state, SimpleNamespace(displacement=affine))
    assert list(found["sigma"]) == ["rest", "truth", "meso32", "meso16"]
    assert list(found["beyond"]) == ["affine", "meso32", "meso16"]
    assert max(found["beyond"].values()) < 1e-5
    assert found["sigma"]["truth"] < 0.1 * found["sigma"]["rest"]
    for name in ("meso32", "meso16"):
        assert found["sigma"][name] == pytest.approx(found["sigma"]["truth"], rel=1e-3)
    assert "rotation" not in found


def test_a_wavy_state_is_harder_for_a_coarser_mesh(state):
    found = judged(state, SimpleNamespace(displacement=wave))
    assert found["beyond"]["affine"] > found["beyond"]["meso32"] > found["beyond"]["meso16"] > 0.01


def test_how_far_struts_turn_is_told_where_it_is_known(state):
    turning = SimpleNamespace(
        displacement=affine, rotation_angles=lambda state: np.linspace(0, 100 * state, 101)
    )
    assert judged(state, turning)["rotation"] == {"median": 50.0, "p95": 95.0}
