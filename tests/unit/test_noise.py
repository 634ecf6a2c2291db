"""Uncertainty of nodes from draws of noise: its size, its frame, and errors that obey it or do not."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from addvc.analysis.noise import (
    BINS,
    calibration,
    figures,
    load_uncertainty,
    sampling_error,
    save_uncertainty,
    standard_uncertainty,
    strut_uncertainty,
    turned,
)
from addvc.analysis.strut_motion import strut_motion
from addvc.analysis.struts import Strut
from addvc.correlation.metric import hessian, reference_on
from addvc.correlation.metric import turned as turned_reference
from addvc.correlation.micro import turns
from addvc.correlation.register import System
from addvc.correlation.uncertainty import Noise, fields_of_noise
from addvc.fem.assembly import node_pattern
from addvc.fem.operators import stiffness
from addvc.fem.quadrature import gauss_points
from addvc.fem.solver import factorise

TURN = Rotation.from_rotvec([0.4, -0.7, 0.5]).as_matrix()
NOISE = Noise(1.5, 0.8)
SHAPE = (24, 24, 24)


def bar(count=600, seed=2417):
    """A straight strut along x of length 12 with nodes anywhere in it, and the nodes (k, 3)."""
    rng = np.random.default_rng(seed)
    line = np.linspace([0.0, 0, 0], [12, 0, 0], 17)
    place = rng.uniform(0, 16, count)
    strut = Strut(
        (0, 1), line, np.full(17, np.pi), 12.0, 14.0, np.arange(count), np.ones(count), place
    )
    points = np.column_stack([place * 12 / 16, *rng.uniform(-1, 1, (2, count))])
    return strut, points


def test_the_uncertainty_is_the_deviation_of_the_vector_to_its_sampling_error(rng):
    """Components of .03, .04 and .12 voxel make .13; 1 / sqrt(2 d) of the largest at most."""
    draws = rng.normal(0, [0.03, 0.04, 0.12], (16, 5000, 3))
    found = standard_uncertainty(draws.astype(np.float32))
    assert np.sqrt(np.mean(found**2)) == pytest.approx(0.13, rel=0.01)
    even = standard_uncertainty(rng.normal(0, 0.1, (16, 5000, 3)))
    assert even.std() / even.mean() == pytest.approx(sampling_error(16), rel=0.05)


def test_parts_of_a_strut_are_along_its_line_and_normal_to_it(rng):
    strut, points = bar()
    draws = rng.normal(0, [0.2, 0.03, 0.04], (400, len(points), 3))
    assert strut_uncertainty([strut], draws)[0] == pytest.approx([0.05, 0.2], rel=0.02)
    assert strut_uncertainty([], draws).shape == (0, 2)


def test_a_turn_keeps_lengths_and_turns_directions(box, rng):
    mesh = box([0] * 3, [6] * 3, (3, 3, 3), shake=0.2)
    draws = rng.normal(0, 0.1, (4, *mesh.points.shape))
    found = turned(mesh, mesh.points @ TURN.T - mesh.points, draws)
    assert found == pytest.approx(draws @ TURN.T)
    assert turned(mesh, 0 * mesh.points, draws) == pytest.approx(draws)


def test_draws_of_a_turned_system_are_the_turned_draws(box, speckle):
    """R A R^T and R b, with the same noise: what `turned` says without solving again."""
    mesh, image = box([4.5] * 3, [18.5] * 3, (3, 3, 3)), speckle(SHAPE, 3.0)
    pattern, systems = node_pattern(mesh), []
    cells = np.broadcast_to(TURN, (len(mesh.cells), 3, 3)).copy()
    rest = reference_on(mesh, gauss_points(mesh), image)
    for reference, rotation in ((rest, None), (turned_reference(rest, cells), cells)):
        energy = 40.0 * stiffness(mesh, 0.3, pattern, rotation)
        systems.append(System(reference, energy, factorise(hessian(reference, pattern) + energy)))
    still, moved = (fields_of_noise(system, SHAPE, NOISE, 3) for system in systems)
    u = mesh.points @ TURN.T - mesh.points
    largest = float(np.abs(moved).max())
    assert turned(mesh, u, still) == pytest.approx(moved, abs=1e-4 * largest)
    assert moved != pytest.approx(still, abs=0.1 * largest)


def test_noise_of_a_strut_that_has_turned_is_that_at_rest(rng):
    """Without turning the draws, noise along the strut would be taken for bending of it."""
    strut, points = bar()
    draws = points[:, :1] * np.multiply.outer(rng.normal(0, 0.01, 8), np.eye(3)[0])[:, None]
    rest = strut_motion(strut, points, 0 * points, draws).noise
    u = points @ TURN.T - points
    moved = strut_motion(strut, points, u, draws @ TURN.T).noise
    assert moved == pytest.approx(rest, rel=1e-6, abs=1e-12)
    assert strut_motion(strut, points, u, draws).noise != pytest.approx(rest, rel=0.1)


@pytest.mark.parametrize(
    ("method", "rotated", "found"),
    [("corotational", True, True), ("corotational", False, False), ("without_shell", True, True),
     ("without_rotation", True, False), ("eq10", True, False)],
)  # fmt: skip
def test_the_frame_of_a_method_turns_or_not(method, rotated, found):
    assert turns({"rotated": rotated}, method) == found


@pytest.mark.parametrize("factor", [1.0, 2.0])
def test_errors_are_judged_by_the_uncertainty_of_their_nodes(rng, factor):
    sigma = rng.uniform(0.05, 0.2, 40000)
    error = factor * rng.normal(0, 1, (40000, 3)) * sigma[:, None] / np.sqrt(3)
    found = calibration(error, sigma)
    assert found["ratio"] == pytest.approx(factor, rel=0.01)
    predicted, actual = np.transpose(found["bins"])
    assert len(predicted) == BINS and (np.diff(predicted) > 0).all()
    assert actual == pytest.approx(factor * predicted, rel=0.05)
    assert found["within_2"] == pytest.approx({1.0: 0.9926, 2.0: 0.6084}[factor], abs=0.01)


def test_no_nodes_are_no_error():
    found = calibration(np.empty((0, 3)), np.empty(0))
    assert found["count"] == 0 and found["bins"] == [] and np.isnan(found["ratio"])


def test_what_is_kept_comes_back(tmp_path, rng):
    nodes, struts = rng.random(9), rng.random((4, 2))
    save_uncertainty(tmp_path / "u.h5", nodes, struts)
    for kept, given in zip(load_uncertainty(tmp_path / "u.h5"), (nodes, struts), strict=True):
        assert (kept == given).all()
    found = figures(nodes, struts, 16)
    assert found["struts_along"] == pytest.approx(np.median(struts[:, 1]))
    assert np.isnan(figures(nodes, np.empty((0, 2)), 16)["struts_normal"])
