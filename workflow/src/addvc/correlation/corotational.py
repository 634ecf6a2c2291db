"""Micro DVC beyond small strain: a weak elastic energy in a frame that turns with the struts.

The functional is S(u) + c (u^T K_R u + 2 u^T f_R): S over the struts and their shell, robust; the
energy of each tetrahedron measured from its own rotation R, so that a strut that turns as a whole
costs nothing; the gradient R grad I_r. R is smoothed and frozen within a stage: a stage then is the
modified Gauss-Newton of Eq. 3, with one factor, of the sparsity of K. A stage is data, and micro
DVC a fold over stages.

Struts that fall into the wrong minimum are mended before the last stage (`correlation.mending`).
l_E is chosen after mending: a strut that is stiff finds its place, one that is not follows whatever
it lies on. With the choice (15 voxels there, from 23) before mending .44 voxel and 99.49 % were left.
"""

import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from addvc.correlation.cutoff import RATIO, Ladder, least_risk, trial_of
from addvc.correlation.gauss_newton import Solution
from addvc.correlation.mending import Mending, mend, trusted
from addvc.correlation.register import System
from addvc.correlation.stages import Problem, Stage, Step, early, run, stage_system
from addvc.correlation.torn import layers

log = logging.getLogger(__name__)

FAR = 2
"""Rungs down the ladder of l_E that one linear step is trusted for; up it, what a longer l_E leaves of
u is nearly linear."""

BRIDGE = 0.5
"""Stiffness of bridges over that of other struts, once struts are mended: they stand for what is thinner
than the mesh can be, or broken. On the default twin, where all are whole, rms errors with 1 / .5 / .3
are .073 / .073 / .074 voxel at 5.2 % and .103 / .104 / .105 at 12.3 %; on the solid twin, where some
are broken, .112 / .107 / .103 at 8 %. With .5 in mending too .170 for .157 on the first at 28.5 %."""

ROUNDS = 2
"""Stages at most to choose l_E in."""


@dataclass(frozen=True, eq=False)
class Course:
    """How far micro DVC has come: its problem, u (n, 3), the stages behind it, the trials of l_E."""

    problem: Problem
    u: np.ndarray
    steps: Sequence[Step] = ()
    trials: Sequence[dict] = ()

    def after(self, steps: Sequence[Step], problem: Problem | None = None) -> "Course":
        """With more stages behind it, those of another problem where one is given."""
        u = steps[-1][0].u if steps else self.u
        return Course(problem or self.problem, u, [*self.steps, *steps], self.trials)


def corotational(
    problem: Problem,
    deformed: np.ndarray,
    u: np.ndarray,
    stages: Sequence[Stage],
    mending: Mending | None = None,
    ladder: Ladder | None = None,
) -> tuple[Solution, dict]:
    """Stages one after the other from u (n, 3); I_d by its spline coefficients (nx, ny, nz).

    Before the last of several come mending and, where there is a ladder, the choice of l_E, with
    bridges of stiffness BRIDGE from then on; what is then in doubt does not count in the last. The
    solution has the history of all stages and converged if the last one did; its notes are those of
    `whole`."""
    *before, last = stages
    course = Course(problem, u)
    for stage in before:
        course = course.after([run(problem, stage, deformed, course.u)])
    if not before:
        mending = ladder = None
    if mending is not None:
        mended, steps = mend(problem, deformed, course.u, last, mending)
        course = course.after(steps, mended)
    course = replace(course, problem=replace(course.problem, bridge=BRIDGE))
    if ladder is not None:
        course = with_cutoff(course, deformed, last, ladder, mending)
    final = course.problem
    if mending is not None:
        final = replace(final, reference=trusted(final.reference, deformed, course.u, mending))
    return whole(course.after([run(final, last, deformed, course.u)], final))


def whole(course: Course) -> tuple[Solution, dict]:
    """The solution of a course, with the history and the time of all stages, and its notes: `stages` has
    a row of figures for each, `c` and `l_e` are the weight of the energy and its cut-off in the end,
    `risk` the trials of l_E, all in grey levels^2 over the points; `torn`: where bridges are cut
    (voxels), `torn_cells`: the cells that this goes across."""
    solutions, rows = zip(*course.steps, strict=True)
    history = [step for solution in solutions for step in solution.history]
    seconds = sum(solution.seconds for solution in solutions)
    problem, cuts = course.problem, course.problem.cuts
    return replace(solutions[-1], history=history, seconds=seconds), {
        "stages": list(rows),
        "c": problem.weight,
        "l_e": problem.cutoff,
        "risk": list(course.trials),
        "torn": [joint.position for joint in cuts],
        "torn_cells": np.flatnonzero(layers(cuts)).tolist(),
    }


def with_cutoff(
    course: Course,
    deformed: np.ndarray,
    last: Stage,
    ladder: Ladder,
    mending: Mending | None = None,
) -> Course:
    """The l_E of least risk, and the stages like the `last`, ended early, that lead there.

    One linear step tells the risk of a shorter l_E only so far: from far off a stage is run with
    the new l_E, and the choice made again. A stage that is not finite leaves l_E as it was. What is in
    doubt does not count where it is mended: a few lost struts ask for an l_E that lets them lie anywhere
    (two twins at 28.5 %, with them / without: 10 / 15 voxels)."""
    stage, rung = replace(last, stop=early(last.stop)), 0
    system = stage_system(course.problem, stage, course.u)
    for number in range(ROUNDS + 1):
        better, course = chosen(course, system, deformed, ladder, rung, mending)
        wanted = course.problem.cut_off(RATIO ** (better - rung))
        log.info("micro DVC: least risk at l_E = %.3g voxels", wanted.cutoff)
        if better - rung >= -FAR or number == ROUNDS:
            return replace(course, problem=wanted)
        system = stage_system(wanted, stage, course.u)
        step = run(wanted, stage, deformed, course.u, "l_E", system)
        if not np.isfinite(step[0].history[-1]):
            return course
        rung, course = better, course.after([step], wanted)


def chosen(
    course: Course,
    system: System,
    deformed: np.ndarray,
    ladder: Ladder,
    rung: int,
    mending: Mending | None,
) -> tuple[int, Course]:
    """The rung of least risk, seen from that of a system, whose u that of the course is; the course with
    the trials that tell it."""
    if mending is not None:
        left = trusted(system.reference, deformed, course.u, mending)
        system = replace(system, reference=left)
    best, trials = least_risk(trial_of(system, deformed, course.u, ladder), ladder, rung)
    named = [trial | {"l_e": trial["times"] * course.problem.cutoff} for trial in trials]
    return best, replace(course, trials=named)
