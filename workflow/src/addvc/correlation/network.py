"""The network fit: what meso DVC has found, as struts that hardly need loads would do it.

A mesh of 12 voxels lets the noise of every element into its displacement, and a Laplacian that keeps it
out keeps the bending of the struts out too. The struts themselves tell both apart: of the motions of
their frame near equilibrium (`correlation.frame_fit`) that one is found which follows the displacement
at points of the micro mesh, robustly, since meso DVC may have put struts in the place of others; and, of
the fields of the mesh, the one that is nearest to it.

How much equilibrium weighs, and whether the frame helps at all, the images choose
(`correlation.network_risk`). No truth and no micro DVC is needed. Where no weight has a smaller risk
than the displacement as it is, that stays: where struts move as no frame in equilibrium does.

Errors on the default twin, voxels rms, of meso 12 / so fitted / of the best field of the mesh: .141 /
.096 / .078 at 3.4 %, .181 / .139 / .119 at 5.2 %, .375 / .303 / .271 at 12.3 %, 1.84 / .86 / .55 at
28.5 %.
"""

import logging
import time
from dataclasses import dataclass, replace

import numpy as np

from addvc.correlation.frame_fit import HELD, Approach, Problem, approached
from addvc.correlation.gauss_newton import Solution
from addvc.correlation.network_risk import RiskData
from addvc.correlation.transfer import Projection
from addvc.fem.carried import NEAR, Attached, first_motion
from addvc.fem.frame import FrameMotion
from addvc.fem.mesh import Mesh
from addvc.geometry.strut_frame import StrutFrame

log = logging.getLogger(__name__)

APPROACH = ((0.0, 1e-1), (1e1, 1e-2), (1e2, 1e-3), (1e3, 1e-4))
"""Weights of equilibrium and of the elastic energy on the way: where struts are in a wrong place an
early equilibrium would be that of a crumpled frame."""

FIRST, LEAST, MOST = 1e3, 1e2, 1e7
"""Weights are tried by tens upwards, or else downwards, as long as the risk falls; below the least the
frame follows whatever it is told."""

BETWEEN = 10**0.5
"""Then on either side of the best: the risk is flat about its least."""

ROUND, FINALLY = 4, 50
"""Iterations with each weight, and with the one that is taken, at most. More on the way lead, where
struts are in a wrong place, to the equilibrium of what is wrong (28.5 %: 1.5 in place of .86 voxel)."""

REACH = 0.75
"""Of the median radius of the struts: a point that is that far from where the frame carries it counts
for a quarter."""

HOLD = 1e-3
"""Weight of the Laplacian beside the mass matrix in what goes back to the mesh: it holds nodes with
hardly any solid around them."""

REFUSALS = {
    "clamped": "all {nodes} nodes of the frame of struts may be loaded from outside (at least one must "
    "not), so that nothing is in equilibrium; widen micro.region",
    "unseen": f"{{near}} points of the micro mesh (at least {NEAR}) are near the frame of struts, which "
    "has {nodes} nodes; see Fig. 8 for what the threshold keeps, and widen micro.region",
    "unsolved": "no motion of the frame of struts, of {nodes} nodes, follows it; see Fig. 10 for where "
    "it is far off",
    "risk": "with the best weight of equilibrium the risk is {least:.4g} grey levels^2, {before:.4g} "
    "without (it must be less), so that the images do not show that it helps",
}
"""Why the displacement stays as it is."""


def refusal(notes: dict) -> str | None:
    """Why the displacement is as it was, from the notes of `network_fit`; None where it is not."""
    return REFUSALS[notes["refused"]].format(**notes) if notes.get("refused") else None


@dataclass(frozen=True, eq=False)
class Trial:
    """A weight, what it leads to, and its risk with the parts of it."""

    weight: float
    found: Approach
    row: dict

    @property
    def risk(self) -> float:
        return self.row["risk"]


@dataclass(frozen=True, eq=False)
class Task:
    """What weights are tried on: the displacement u (Q, 3) of points, of which the frame of the problem
    carries some, `near` (Q,); what noise makes of it, answers (d, Q, 3); the images that judge it, and
    the share of the draws that is noise."""

    problem: Problem
    near: np.ndarray
    u: np.ndarray
    answers: np.ndarray
    data: RiskData
    share: float

    def before(self) -> dict:
        """The risk of the displacement as it is."""
        return {"weight": 0.0} | self.data.risk(self.u, self.answers, self.share)

    def change(self, motion: FrameMotion) -> np.ndarray:
        """What a motion of the frame adds to u, (Q, 3)."""
        change = np.zeros_like(self.u)
        change[self.near] = self.problem.attached.moved(motion) - self.problem.now
        return change

    def trial(self, weight: float, motion: FrameMotion, iterations: int = ROUND) -> Trial | None:
        """A weight from a motion; None where no other motion is found."""
        found = approached(self.problem, motion, weight, HELD, iterations)
        if found is None:
            return None
        answers = self.answers.copy()
        answers[:, self.near] = found.kept(self.answers[:, self.near])
        moved = self.u + self.change(found.motion)
        return Trial(weight, found, {"weight": weight} | self.data.risk(moved, answers, self.share))


def network_fit(
    frame: StrutFrame, mesh: Mesh, solution: Solution, data: RiskData, nu: float
) -> tuple[Solution, dict]:
    """What meso DVC has found on the mesh as the frame would do it, and notes: the weight, and the risk
    of each that was tried and of the displacement as it was (weight 0). That stays where the weight is
    None: `refused`, a key of REFUSALS, says why. nu: Poisson's ratio."""
    started, q = time.perf_counter(), data.reference.quadrature
    attached = Attached.of(frame.frame, q.points) if len(frame.frame.pieces) else None
    near = np.zeros(len(q), bool) if attached is None else attached.within
    notes = {"nodes": len(frame.frame.points), "near": int(near.sum()), "trials": []}
    refused = obstacle(frame, near)
    if refused is not None:
        return as_it_was(solution, notes | {"refused": refused})
    project = Projection(mesh, q.points, q.weight, HOLD, change=True)
    task = task_of(frame, attached, project, solution, data, nu)
    trials = searched(task, first_motion(frame.frame, q.points[near], task.u[near]))
    best, before = min(trials, key=lambda one: one.risk, default=None), task.before()
    rows = [before, *(one.row for one in sorted(trials, key=lambda one: one.weight))]
    notes |= {"trials": rows, "before": before["risk"], "least": best and best.risk}
    if best is None or not best.risk < before["risk"]:
        return as_it_was(solution, notes | {"refused": "unsolved" if best is None else "risk"})
    last = task.trial(best.weight, best.found.motion, FINALLY)
    best = last if last is not None and last.risk < before["risk"] else best
    log.info("weight %.3g: risk %.4f, %.4f without", best.weight, best.risk, before["risk"])
    u = solution.u + project.nodal(task.change(best.found.motion))
    found = replace(
        solution,
        u=u,
        history=[step for one in [*trials, best] for step in one.found.steps],
        converged=solution.converged and best.found.settled,
        seconds=time.perf_counter() - started,
        residual=data.residual(project.at_points @ u),
    )
    return found, notes | {"weight": best.weight, "refused": None}


def task_of(
    frame: StrutFrame,
    attached: Attached,
    project: Projection,
    solution: Solution,
    data: RiskData,
    nu: float,
) -> Task:
    """What weights are tried on, from what meso DVC has found."""
    u, near = project.at_points @ solution.u, attached.within
    answers = np.stack([project.at_points @ one for one in data.answers])
    now = (data.reference.quadrature.points + u)[near]
    problem = Problem(frame, attached[near], now, nu, REACH * float(np.median(frame.frame.radius)))
    return Task(problem, near, u, answers, data, data.share(u, answers))


def obstacle(frame: StrutFrame, near: np.ndarray) -> str | None:
    """What keeps the fit from being tried: a key of REFUSALS, None for nothing."""
    if near.sum() < NEAR:
        return "unseen"
    return "clamped" if frame.loaded[frame.frame.pieces].all() else None


def as_it_was(solution: Solution, notes: dict) -> tuple[Solution, dict]:
    """The solution, with the notes that say why."""
    log.info("the displacement stays as it is: %s", refusal(notes))
    return solution, notes | {"weight": None}


def searched(task: Task, motion: FrameMotion) -> list[Trial]:
    """The trials of weights, from the first motion of the frame; none where it cannot be solved."""
    for weight, elastic in APPROACH:
        found = approached(task.problem, motion, weight, elastic, ROUND)
        if found is None:
            return []
        motion = found.motion
    first = task.trial(FIRST, motion)
    if first is None:
        return []
    trials = downhill(task, first, 10.0)
    if min(trials, key=lambda one: one.risk) is first:
        trials += downhill(task, first, 0.1)[1:]
    best = min(trials, key=lambda one: one.risk)
    beside = (
        task.trial(best.weight * times, best.found.motion) for times in (1 / BETWEEN, BETWEEN)
    )
    return trials + [one for one in beside if one is not None]


def downhill(task: Task, first: Trial, times: float) -> list[Trial]:
    """The first trial and those with `times` the weight of the one before, as long as the risk falls."""
    trials = [first]
    while LEAST <= trials[-1].weight * times * (1 + 1e-9) <= MOST * (1 + 1e-6):
        one = task.trial(trials[-1].weight * times, trials[-1].found.motion)
        if one is None:
            break
        trials.append(one)
        if not one.risk < trials[-2].risk:
            break
    return trials
