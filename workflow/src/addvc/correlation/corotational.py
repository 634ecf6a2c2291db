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
    solution has the history of all stages and converged if the last one did; of the notes, `stages` has
    a row of figures for each, `c` and `l_e` are the weight of the energy and its cut-off in the end,
    `risk` the trials of l_E, all in grey levels^2 over the points; `torn`: where bridges are cut
    (voxels), `torn_cells`: the cells that this goes across."""
    *before, last = stages
    done: list[Step] = []
    trials: list[dict] = []
    for stage in before:
        done.append(run(problem, stage, deformed, u))
        u = done[-1][0].u
    if mending is not None and before:
        problem, steps = mend(problem, deformed, u, last, mending)
        done += steps
        u = done[-1][0].u
    problem = replace(problem, bridge=BRIDGE)
    if ladder is not None and before:
        choice = with_cutoff(problem, deformed, u, last, ladder, mending)
        problem, u, trials = choice.problem, choice.u, choice.trials
        done += choice.steps
    if mending is not None and before:
        problem = replace(problem, reference=trusted(problem.reference, deformed, u, mending))
    done.append(run(problem, last, deformed, u))
    solutions, rows = zip(*done, strict=True)
    history = [step for solution in solutions for step in solution.history]
    seconds = sum(solution.seconds for solution in solutions)
    notes = {"stages": list(rows), "c": problem.weight, "l_e": problem.cutoff, "risk": trials}
    notes |= {"torn": [joint.position for joint in problem.cuts]}
    notes |= {"torn_cells": np.flatnonzero(layers(problem.cuts)).tolist()}
    return replace(solutions[-1], history=history, seconds=seconds), notes


@dataclass(frozen=True, eq=False)
class Choice:
    """The problem with the l_E that was chosen, the u (n, 3) from there, the stages that it took, the
    trials."""

    problem: Problem
    u: np.ndarray
    steps: list[Step]
    trials: list[dict]


def with_cutoff(
    problem: Problem,
    deformed: np.ndarray,
    u: np.ndarray,
    last: Stage,
    ladder: Ladder,
    mending: Mending | None = None,
) -> Choice:
    """The l_E of least risk, from u (n, 3), by stages like the `last` that are ended early.

    One linear step from u tells the risk of a shorter l_E only so far: from far off a stage is run with
    the new l_E, and the choice made again. A stage that is not finite leaves l_E as it was. What is in
    doubt does not count where it is mended: a few lost struts ask for an l_E that lets them lie anywhere
    (two twins at 28.5 %, with them / without: 10 / 15 voxels)."""
    stage = replace(last, stop=early(last.stop))
    found, rung, wanted = Choice(problem, u, [], []), 0, problem
    for number in range(ROUNDS + 1):
        system = stage_system(wanted, stage, found.u)
        if number > 0:
            step = run(wanted, stage, deformed, found.u, "l_E", system)
            if not np.isfinite(step[0].history[-1]):
                return found
            found = replace(found, problem=wanted, u=step[0].u, steps=[*found.steps, step])
        if mending is not None:
            left = trusted(system.reference, deformed, found.u, mending)
            system = replace(system, reference=left)
        best, trials = least_risk(trial_of(system, deformed, found.u, ladder), ladder, rung)
        found = replace(found, trials=[t | {"l_e": t["times"] * wanted.cutoff} for t in trials])
        wanted = wanted.cut_off(RATIO ** (best - rung))
        log.info("micro DVC: least risk at l_E = %.3g voxels", wanted.cutoff)
        if best - rung >= -FAR:
            break
        rung = best
    return replace(found, problem=wanted)
