"""Corotational micro DVC on a small frame of struts whose motion is known."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from addvc.correlation.corotational import corotational
from addvc.correlation.cutoff import Ladder
from addvc.correlation.doubt import doubtful_nodes, without
from addvc.correlation.mending import Mending
from addvc.correlation.micro import elastic, mending, micro_options, micro_reference, stages
from addvc.correlation.register import Stop
from addvc.correlation.stages import Problem, Stage
from addvc.correlation.uncertainty import Noise
from verification.frame import CENTRE, CORNERS, SECTION, SHAPE, image, rms_error

LAST = Stop(1e-4, 40)


def turned_by(degrees):
    """A rigid turn about an oblique axis: u at points, and where a voxel comes from."""
    axis = np.array([1.0, 2.0, -1.0]) / np.sqrt(6)
    rotation = Rotation.from_rotvec(np.radians(degrees) * axis).as_matrix()
    return (
        lambda x: (x - CENTRE) @ rotation.T + CENTRE - x,
        lambda x: (x - CENTRE) @ rotation + CENTRE,
    )


def test_no_motion_is_no_motion(problem, still):
    still_u = np.zeros_like(problem.reference.mesh.points)
    solution, _ = corotational(problem, still, still_u, [Stage(True, 15.0, LAST)])
    assert solution.converged and solution.iterations == 1
    np.testing.assert_array_equal(solution.u, 0)


@pytest.mark.parametrize("degrees", [5, 20, 40])
def test_a_large_turn_costs_no_energy(problem, degrees):
    """From half a voxel off, to a tenth of the blur of the edges, whatever the angle."""
    forth, back = turned_by(degrees)
    points = problem.reference.mesh.points
    truth = forth(points)
    wave = 0.5 * np.sin(2 * np.pi * points[:, [1, 2, 0]] / 30)
    plan = [Stage(True, 15.0, Stop(1e-2, 10)), Stage(True, 15.0, LAST)]
    solution, notes = corotational(problem, image(back, 31), truth + wave, plan)
    assert solution.converged
    assert rms_error(solution.u, truth) < 0.06 < rms_error(truth + wave, truth) / 5
    assert len(solution.history) == sum(row["iterations"] for row in notes["stages"])


def test_without_rotation_a_large_turn_is_an_error(problem):
    forth, back = turned_by(40)
    truth, deformed = forth(problem.reference.mesh.points), image(back, 31)
    error = {}
    for rotated in (True, False):
        plan = [Stage(rotated, 15.0, LAST)]
        error[rotated] = rms_error(corotational(problem, deformed, truth, plan)[0].u, truth)
    assert error[False] > 3 * error[True]


def test_robust_weights_leave_out_what_the_reference_does_not_show(problem):
    """Something bright comes to lie against a strut in the deformed image only."""
    points = problem.reference.mesh.points
    deformed = image(lambda x: x, 31)
    beside = (CORNERS[0] + CORNERS[1]) / 2 + [0, 3, 0]
    voxels = np.moveaxis(np.indices(SHAPE), 0, -1) - beside
    deformed += (90 * np.exp(-((voxels**2).sum(-1)) / 6)).astype(np.float32)
    near = np.linalg.norm(points - beside, axis=1) < 5
    error = {}
    for scale in (15.0, None):
        solution, _ = corotational(problem, deformed, 0 * points, [Stage(True, scale, LAST)])
        error[scale] = rms_error(solution.u[near], 0)
    assert error[15.0] < 0.5 * error[None]


def test_the_shell_brings_the_error_down(problem, still):
    """Twice the flanks: less noise in the position of a strut."""
    mesh = problem.reference.mesh
    bare = micro_reference(mesh, still)
    c = elastic(bare, micro_options(SECTION, 20.0, 1))[2]["c"]
    forth, back = turned_by(5)
    truth = forth(mesh.points)
    error = []
    for given in (problem, Problem(bare, c, problem.nu)):
        found = [
            corotational(given, image(back, seed), truth, [Stage(True, None, LAST)])[0].u
            for seed in (31, 32, 33)
        ]
        error.append(np.mean([rms_error(u, truth) for u in found]))
    assert error[0] < error[1]


def off_course(points, truth):
    """The truth but for the middle of one strut, which is 8 voxels off."""
    middle = (CORNERS[1] + CORNERS[2]) / 2
    bump = np.exp(-np.sum((points - middle) ** 2, axis=1) / (2 * 5.0**2))
    return truth + 8 * bump[:, None] * np.array([0.0, 0.6, 0.8])


def test_a_strut_that_went_astray_is_mended(problem):
    """Of so few struts, one is more than a tenth of the nodes."""
    forth, back = turned_by(20)
    points = problem.reference.mesh.points
    truth, deformed = forth(points), image(back, 31)
    start = off_course(points, truth)
    plan = [Stage(True, 15.0, Stop(1e-2, 10)), Stage(True, 15.0, LAST)]
    lost, _ = corotational(problem, deformed, start, plan)
    found, notes = corotational(problem, deformed, start, plan, Mending(3, 4.0, most=0.5))
    assert rms_error(lost.u, truth) > 0.2
    assert rms_error(found.u, truth) < 0.06
    assert found.converged
    assert [row["stage"] for row in notes["stages"]][1:3] == ["carried", "carried"]


def test_two_stages_choose_a_length_and_mend(problem):
    forth, back = turned_by(20)
    points = problem.reference.mesh.points
    truth, deformed = forth(points), image(back, 31)
    plan = [Stage(True, 15.0, Stop(1e-2, 10)), Stage(True, 15.0, LAST)]
    ladder = Ladder(Noise(1.5, 0.0), shortest=0, longest=1)
    mend = Mending(3, 4.0, most=0.5)
    found, notes = corotational(problem, deformed, off_course(points, truth), plan, mend, ladder)
    assert notes["risk"] and "carried" in [row["stage"] for row in notes["stages"]]
    assert rms_error(found.u, truth) < 0.06


def test_no_stage_of_mending_is_longer_than_the_last_may_be(problem):
    forth, back = turned_by(20)
    points = problem.reference.mesh.points
    start = off_course(points, forth(points))
    plan = [Stage(True, 15.0, Stop(1e-9, 3)), Stage(True, 15.0, Stop(1e-10, 3))]
    _, notes = corotational(problem, image(back, 31), start, plan, Mending(1, 4.0, most=0.5))
    rows = notes["stages"]
    assert [row["stage"] for row in rows[1:5]] == ["carried", "carried", "wide", "narrow"]
    assert [row["iterations"] for row in rows] == [3] * 6


def test_nothing_is_mended_where_nothing_is_in_doubt(problem, still):
    start = np.zeros_like(problem.reference.mesh.points)
    plan = [Stage(True, 15.0, LAST)]
    solution, notes = corotational(problem, still, start, plan, Mending(3, 4.0))
    assert len(notes["stages"]) == 1
    np.testing.assert_array_equal(solution.u, 0)


@pytest.mark.parametrize("limit", [0.0, 4.0])
def test_an_image_of_nothing_is_a_result_that_did_not_converge_or_moves_nowhere(problem, limit):
    """All nodes are in doubt: no one is let go, and the system stays regular."""
    noise = np.random.default_rng(2417).normal(60, 20, SHAPE).astype(np.float32)
    start = np.zeros_like(problem.reference.mesh.points)
    plan = [Stage(True, 15.0, Stop(1e-2, 3)), Stage(True, 15.0, Stop(1e-4, 3))]
    solution, notes = corotational(problem, noise, start, plan, Mending(2, limit))
    assert len(notes["stages"]) == 2 and np.isfinite(solution.u).all()
    doubtful = doubtful_nodes(problem.reference, noise, solution.u, limit)
    assert doubtful.mean() > 0.5


def test_no_cycles_no_mending():
    levels = {"noise_at_points": 2.0}
    assert mending({"mending": 0}, levels) is None
    assert mending({"mending": 3}, levels).cycles == 3


def test_doubt_lies_where_the_displacement_is_wrong(problem):
    forth, back = turned_by(20)
    points = problem.reference.mesh.points
    truth, deformed = forth(points), image(back, 31)
    assert not doubtful_nodes(problem.reference, deformed, truth, 6.0).any()
    start = off_course(points, truth)
    doubtful = doubtful_nodes(problem.reference, deformed, start, 6.0)
    away = np.linalg.norm(start - truth, axis=1)
    assert doubtful[away > 3].all() and not doubtful[away < 1e-3].any()
    left = without(problem.reference, doubtful).quadrature.weight
    dropped = left < problem.reference.quadrature.weight
    assert (left[dropped] == 0).all() and 0 < dropped.mean() < 0.5


def test_the_scale_follows_the_noise_but_not_below_a_third_of_the_contrast():
    section = {
        "robust": "auto",
        "rotated": True,
        "stages": 3,
        "tolerance": 1e-3,
        "max_iterations": 40,
    }
    levels = {"void": 20.0, "solid": 80.0, "noise_at_points": 3.0}
    plan = stages(section, levels)
    assert [stage.scale for stage in plan] == [36.0] * 3
    assert [stage.stop for stage in plan] == [Stop(1e-2, 10)] * 2 + [Stop(1e-3, 40)]
    assert stages(section, levels | {"noise_at_points": 0.0})[0].scale == 20.0
    assert stages(section | {"robust": 12}, levels)[0].scale == 12.0
    assert stages(section | {"robust": "none"}, levels)[0].scale is None
    assert stages(section, levels, "without_robust")[0].scale is None
    assert not stages(section, levels, "without_rotation")[0].rotated
