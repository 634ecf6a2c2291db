"""l_E is the one that the error wants, known from the images alone."""

import numpy as np
import pytest

from addvc.config import chooses
from addvc.correlation import corotational as corotational_module
from addvc.correlation.corotational import Course, corotational, with_cutoff
from addvc.correlation.cutoff import RATIO, Ladder, least_risk, risk, trial_of
from addvc.correlation.gauss_newton import Solution
from addvc.correlation.mending import Mending
from addvc.correlation.metric import hessian
from addvc.correlation.micro import ladder
from addvc.correlation.register import Stop, register
from addvc.correlation.stages import Stage, stage_system
from addvc.correlation.uncertainty import Noise
from addvc.fem.assembly import node_pattern
from verification.frame import CORNERS, image, rms_error

NOISE = 1.5
LADDER = Ladder(Noise(NOISE, 0.0), shortest=-4, longest=3)
PLAN = [Stage(True, None, Stop(1e-3, 20)), Stage(True, None, Stop(1e-3, 20))]


def bowed(amplitude, period):
    """A wave of the frame: u at points, and where a voxel comes from (to second order)."""
    wave = lambda x: amplitude * np.sin(2 * np.pi * x[:, [1, 2, 0]] / period)  # noqa: E731
    return wave, lambda x: x - wave(x - wave(x))


def found(problem, deformed):
    """A converged trial of the problem from rest."""
    rest = np.zeros_like(problem.reference.mesh.points)
    system = stage_system(problem, PLAN[0], rest)
    solution = register(system, deformed, rest, PLAN[0].stop)
    return trial_of(system, deformed, solution.u, Ladder(LADDER.noise, draws=8))


def test_risks_differ_as_the_errors_do(problem):
    """In the metric of H, for frames that did not move: error and risk fall together with l_E."""
    h = hessian(problem.reference, node_pattern(problem.reference.mesh))
    differences = []
    for seed in (31, 32, 33, 34):
        error, risks = [], []
        for times in (1 / RATIO, RATIO):
            one = found(problem.cut_off(times), image(lambda x: x, seed))
            error.append(one.u.ravel() @ (h @ one.u.ravel()))
            risks.append(risk(one, 1.0)["risk"])
        differences.append((error[0] - error[1], risks[0] - risks[1]))
    errors, risks = np.array(differences).T
    assert (errors > 0).all()
    assert risks.mean() == pytest.approx(errors.mean(), rel=0.3)


def test_a_linear_step_tells_what_the_other_cut_off_gives(problem):
    deformed = image(bowed(0.3, 30)[1], 31)
    here, there = found(problem, deformed), found(problem.cut_off(RATIO), deformed)
    assert risk(here, RATIO)["misfit"] == pytest.approx(risk(there, 1.0)["misfit"], rel=0.02)
    assert risk(here, RATIO)["freedom"] == pytest.approx(risk(there, 1.0)["freedom"], rel=0.05)


def test_short_waves_want_a_shorter_cut_off_than_rest(problem):
    rest, _ = least_risk(found(problem, image(lambda x: x, 31)), LADDER, 0)
    rough, _ = least_risk(found(problem, image(bowed(1.0, 12)[1], 31)), LADDER, 0)
    assert rest == LADDER.longest and rough < 0


def test_noise_that_the_residual_does_not_hold_is_none(problem):
    """The texture of a void that is not empty: here the noise is said to be ten times what it is."""
    rest = np.zeros_like(problem.reference.mesh.points)
    deformed = image(lambda x: x, 31)
    system = stage_system(problem, PLAN[0], rest)
    u = register(system, deformed, rest, PLAN[0].stop).u
    shares = [trial_of(system, deformed, u, Ladder(Noise(t * NOISE, 0.0))).share for t in (1, 10)]
    assert shares[0] == pytest.approx(1, abs=0.2)
    assert shares[1] == pytest.approx(0.01, rel=0.2)


@pytest.mark.parametrize("period", [12, 40])
def test_the_choice_is_close_to_the_best_of_the_ladder(problem, period):
    wave, back = bowed(0.6, period)
    truth, deformed = wave(problem.reference.mesh.points), image(back, 31)
    start = np.zeros_like(truth)
    errors = [
        rms_error(corotational(problem.cut_off(RATIO**k), deformed, start, PLAN)[0].u, truth)
        for k in range(LADDER.shortest, LADDER.longest + 1)
    ]
    solution, notes = corotational(problem, deformed, start, PLAN, ladder=LADDER)
    assert rms_error(solution.u, truth) < 1.15 * min(errors)
    assert notes["l_e"] / problem.cutoff == pytest.approx((notes["c"] / problem.weight) ** 0.5)


def test_a_lost_strut_does_not_ask_for_a_short_length(problem):
    """In a frame at rest, one strut so far off that it stays there: what it needs is no l_E."""
    points = problem.reference.mesh.points
    deformed, middle = image(lambda x: x, 31), (CORNERS[1] + CORNERS[2]) / 2
    bump = np.exp(-np.sum((points - middle) ** 2, axis=1) / (2 * 5.0**2))
    start = 8 * bump[:, None] * np.array([0.0, 0.6, 0.8])
    stage, mending = Stage(True, None, Stop(1e-2, 10)), Mending(2, 6.0, most=0.5)
    lengths = [
        with_cutoff(Course(problem, start), deformed, stage, LADDER, given).problem.cutoff
        for given in (None, mending)
    ]
    assert lengths[1] > 2 * lengths[0]


@pytest.fixture
def chosen(problem, monkeypatch):
    """chosen(rungs, steps): the choice where the least risk is on these rungs, one after the other, and
    the stages end by these steps; and the l_E of the stages that were run."""

    def choose(rungs, steps=(1e-4, 1e-4)):
        lengths, rest = [], np.zeros_like(problem.reference.mesh.points)
        rungs, ends = iter(rungs), iter(steps)

        def stage_of(given, stage, deformed, u, name, system):
            lengths.append(given.cutoff / problem.cutoff)
            return Solution(u, [next(ends)], True, 0.0, {}), {}

        monkeypatch.setattr(corotational_module, "run", stage_of)
        monkeypatch.setattr(
            corotational_module, "least_risk", lambda *_: (next(rungs), [{"times": 1.0}])
        )
        course = Course(problem, rest)
        return with_cutoff(course, image(lambda x: x, 31), PLAN[0], LADDER), lengths

    return choose


def test_far_from_where_it_was_a_stage_is_run_and_the_choice_made_again(problem, chosen):
    choice, lengths = chosen([-4, -3])
    assert lengths == [pytest.approx(RATIO**-4)] and len(choice.steps) == 1
    assert choice.problem.cutoff == pytest.approx(problem.cutoff * RATIO**-3)


@pytest.mark.parametrize("rung", [1, 5])
def test_a_longer_one_is_trusted_at_once(problem, chosen, rung):
    choice, lengths = chosen([rung])
    assert lengths == [] and choice.problem.cutoff == pytest.approx(problem.cutoff * RATIO**rung)


def test_from_a_shorter_one_the_way_back_is_open(problem, chosen):
    choice, lengths = chosen([-4, 0])
    assert lengths == [pytest.approx(RATIO**-4)]
    assert choice.problem.cutoff == pytest.approx(problem.cutoff)


def test_a_stage_that_is_not_finite_leaves_the_length_as_it_was(problem, chosen):
    choice, lengths = chosen([-4], [np.nan])
    assert len(lengths) == 1 and not choice.steps
    assert choice.problem.cutoff == problem.cutoff


def test_a_given_length_is_not_chosen():
    section = {"l_e": "auto", "stages": 3}
    assert ladder(section, {"noise": 2.0}, 0.8, "corotational").noise == Noise(2.0, 0.8)
    assert ladder(section, {"noise": 2.0}, 0.8, "eq10") is None
    for change in ({"l_e": 23.0}, {"stages": 1}, {"times": {"l_e": 2}}):
        assert not chooses(section | change, "corotational")
    assert not chooses(section, "without_choice")
    assert chooses(section | {"times": {"l_k": 2}}, "without_shell")
