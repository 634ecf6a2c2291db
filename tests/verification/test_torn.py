"""A bridge that the images tear is cut; one whose strut has only gone astray is not."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from scipy.spatial.transform import Rotation

from addvc.correlation.corotational import BRIDGE as SOFTER
from addvc.correlation.corotational import corotational
from addvc.correlation.gauss_newton import Solution
from addvc.correlation.mending import Mending
from addvc.correlation.micro import elastic, micro_options, micro_reference, system_at_rest
from addvc.correlation.register import Stop
from addvc.correlation.stages import Problem, Stage, stage_system
from addvc.correlation.store import save_factor, save_solution
from addvc.correlation.torn import SOFT, apart, joints_of, torn_joints
from addvc.fem.mesh import cell_volumes
from addvc.fem.operators import corotational_load, stiffness
from addvc.fem.shell import shell_points
from addvc.geometry.stuffing import stuff
from verification.frame import SECTION, image, rms_error

ENDS = np.array([[12.0, 21.5, 21.5], [31.0, 21.5, 21.5]])
FEET = [(0, (4, 10, 12)), (0, (4, 33, 28)), (1, (39, 10, 28)), (1, (39, 33, 12))]
LINES = [tuple(ENDS), *((ENDS[end], np.array(foot, dtype=float)) for end, foot in FEET)]
MIDDLE = ENDS.mean(axis=0)
BRIDGE = {
    "position": MIDDLE.tolist(),
    "thinnest": MIDDLE.tolist(),
    "direction": [1.0, 0.0, 0.0],
    "length": 4.0,
    "radius": 1.4,
}
PLAN = [Stage(True, 15.0, Stop(1e-2, 10)), Stage(True, 15.0, Stop(1e-4, 40))]
MEND = Mending(2, 4.0, most=0.6)
SLIP = np.array([0.0, 1.8, 2.4])
"""Half of what lies left of the middle from what lies right of it, voxels."""


@pytest.fixture(scope="module")
def problem():
    """Two pairs of feet that a strut joins."""
    still = image(lambda x: x, 2417, LINES)
    mesh = stuff(still, 60.0, 1.6)
    reference = micro_reference(mesh, still, shell_points(mesh, still, 60.0))
    options = micro_options(SECTION, 20.0, 1)
    return Problem(reference, elastic(reference, options)[2]["c"], options.nu, options.l_e)


@pytest.fixture(scope="module")
def bridged(problem):
    """The same; the strut is a bridge in its middle."""
    return replace(problem, joints=joints_of(problem.reference.mesh, [BRIDGE]))


def side(x):
    """-1 left of the middle, 1 right of it."""
    return np.sign(x[:, [0]] - MIDDLE[0])


def test_halves_that_slide_past_each_other_are_cut_and_found(problem, bridged):
    """From a start that is right at the feet and smooth in between, as that of free-form DVC."""
    points = problem.reference.mesh.points
    truth = side(points) * SLIP
    deformed = image(lambda x: x - side(x) * SLIP, 31, LINES)
    start = np.tanh((points[:, [0]] - MIDDLE[0]) / 6) * SLIP
    whole, _ = corotational(problem, deformed, start, PLAN, MEND)
    cut, notes = corotational(bridged, deformed, start, PLAN, MEND)
    assert cut.converged and notes["torn"] == [BRIDGE["thinnest"]]
    assert rms_error(cut.u, truth) < 0.3 * rms_error(whole.u, truth)
    across = side(points)[problem.reference.mesh.cells[notes["torn_cells"]]]
    assert (np.abs(across.sum(axis=1)) < across.shape[1]).all(), "torn cells have both sides"


def test_a_strut_that_went_astray_is_not_cut(problem, bridged):
    """It lies as far off, and is in doubt as well."""
    points = problem.reference.mesh.points
    bump = np.exp(-np.sum((points - MIDDLE) ** 2, axis=1) / (2 * 4.0**2))
    start = 2 * bump[:, None] * SLIP
    found, notes = corotational(bridged, image(lambda x: x, 31, LINES), start, PLAN, MEND)
    assert "carried" in [row["stage"] for row in notes["stages"]]
    assert notes["torn"] == notes["torn_cells"] == []
    assert rms_error(found.u, 0 * points) < 0.06


def test_a_bridge_is_softer_than_the_other_struts_and_a_cut_softer_still(bridged):
    """Stretched along itself, each cell stores energy by its modulus."""
    mesh, (joint,) = bridged.reference.mesh, bridged.joints
    soft = replace(bridged, bridge=0.5)
    assert_array_equal(soft.modulus, np.where(joint.around, 0.5, 1.0))
    assert_array_equal(soft.tear([joint]).modulus[joint.layer], SOFT)
    u = mesh.points * [0.01, 0, 0]
    energy = [
        u.ravel() @ (stage_system(one, PLAN[0], 0 * u).regularisation @ u.ravel())
        for one in (bridged, soft)
    ]
    share = cell_volumes(mesh)[joint.around].sum() / cell_volumes(mesh).sum()
    assert energy[1] / energy[0] == pytest.approx(1 - share / 2)


def test_the_noise_of_a_state_is_that_of_its_last_stage(bridged, tmp_path):
    """Bridges soft, and torn where the state has torn them; as stiff as the rest before any state."""
    (joint,), factor, solved = bridged.joints, tmp_path / "factor.h5", tmp_path / "state1.h5"
    soft, rest = replace(bridged, bridge=SOFTER), Stage(rotated=False)
    system, u = stage_system(bridged, rest, None), 0 * bridged.reference.mesh.points
    notes = {"c": bridged.weight, "l_e": bridged.cutoff}
    save_factor(factor, system.factor, system.regularisation.tocsr(), notes)
    given = bridged.reference, "corotational", bridged.nu, factor
    for last, torn in ((soft, []), (soft.tear([joint]), [BRIDGE["thinnest"]])):
        save_solution(solved, Solution(u, [0.0], True, 0.0, {}), torn=torn, **notes)
        found = system_at_rest(*given, solved, [BRIDGE])
        known = stage_system(last, rest, None)
        assert abs(found.regularisation - known.regularisation).max() == 0
        assert_array_equal(found.reference.quadrature.weight, known.reference.quadrature.weight)
    before = system_at_rest(*given, None, [BRIDGE]).regularisation
    assert abs(before - system.regularisation).max() == 0


def test_a_cut_goes_across_one_strut_and_nothing_else(bridged):
    mesh, (joint,) = bridged.reference.mesh, bridged.joints
    middle = mesh.points[mesh.cells[joint.layer]].mean(axis=1)
    assert np.abs(middle - MIDDLE)[:, 0].max() < 1.6
    assert np.linalg.norm(middle - MIDDLE, axis=1).max() < 1.4 + 2.0
    nodes = np.unique(mesh.cells[joint.layer])
    assert sorted(np.concatenate(joint.sides)) == nodes.tolist()
    gap = np.linalg.norm(joint.offset)
    assert apart(joint, side(mesh.points) * SLIP) == pytest.approx(np.hypot(6, gap) - gap, abs=0.2)
    turn = Rotation.from_rotvec([0.3, 0.5, -1.0]).as_matrix() - np.eye(3)
    assert apart(joint, (mesh.points - MIDDLE) @ turn.T) == pytest.approx(0.0, abs=1e-9)
    assert apart(joint, np.ones_like(mesh.points)) == pytest.approx(0.0)
    q = bridged.tear([joint]).reference.quadrature
    assert ((q.weight == 0) == joint.layer[q.cell]).all()
    assert bridged.tear([]) is bridged


@pytest.mark.parametrize("doubt", [False, True])
def test_only_a_bridge_in_doubt_is_cut_on_trial(bridged, doubt):
    mesh = bridged.reference.mesh
    found = torn_joints(mesh, bridged.joints, np.full(len(mesh.points), doubt))
    assert found == (list(bridged.joints) if doubt else [])


def test_a_bridge_outside_of_the_mesh_is_left_out(problem):
    assert (
        joints_of(
            problem.reference.mesh,
            [BRIDGE | {"position": [1.0, 40.0, 1.0], "thinnest": [1.0, 40.0, 1.0]}],
        )
        == []
    )


def test_energy_and_forces_go_with_the_modulus_of_each_cell(problem):
    mesh, rng = problem.reference.mesh, np.random.default_rng(2417)
    turns = Rotation.random(len(mesh.cells), random_state=rng).as_matrix()
    part = rng.uniform(size=len(mesh.cells)) < 0.5
    of = lambda modulus: (  # noqa: E731
        stiffness(mesh, 0.3, rotation=turns, modulus=modulus),
        corotational_load(mesh, 0.3, turns, modulus),
    )
    (k, f), (k1, f1), (k2, f2) = of(1.0), of(1.0 * part), of(1.0 * ~part)
    assert abs(k1 + k2 - k).max() < 1e-12 * abs(k).max()
    np.testing.assert_allclose(f1 + f2, f, atol=1e-12 * np.abs(f).max())
