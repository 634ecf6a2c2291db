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
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from addvc.correlation.frame_fit import HELD, Approach, Problem, approached
from addvc.correlation.gauss_newton import Solution
from addvc.correlation.network_risk import Images
from addvc.correlation.transfer import Projection
from addvc.fem.carried import NEAR, Attached, first_motion
from addvc.fem.frame import FrameMotion
from addvc.fem.mesh import Mesh
from addvc.geometry.strut_frame import StrutFrame

log = logging.getLogger(__name__)

APPROACH = ((0.0, 1e-1), (1e1, 1e-2), (1e2, 1e-3), (1e3, 1e-4))
"""Weights of equilibrium and of the elastic energy on the way: where struts are in a wrong place an
early equilibrium would be that of a crumpled frame."""

WEIGHTS, BETWEEN = (1e3, 1e4, 1e5, 1e6), 10**0.5
"""Tried until the risk rises, then on either side of the best. The risk is flat about its least."""

ROUND, FINALLY = 4, 30
"""Iterations with each weight, and with the one that is taken, at most. More on the way lead, where
struts are in a wrong place, to the equilibrium of what is wrong (28.5 %: 1.5 in place of .86 voxel)."""

REACH = 0.75
"""Of the median radius of the struts: a point that is that far from where the frame carries it counts
for a quarter."""

HOLD = 1e-3
"""Weight of the Laplacian beside the mass matrix in what goes back to the mesh: it holds nodes with
hardly any solid around them."""

REFUSALS = {
    "clamped": "no node of the frame of struts is free of loads from outside",
    "unseen": f"fewer than {NEAR} points of the micro mesh are near the frame of struts",
    "unsolved": "no motion of the frame of struts was found",
    "risk": "no weight of equilibrium has a smaller risk than the displacement as it is",
}
"""Why the displacement stays as it is."""


@dataclass(frozen=True, eq=False)
class Trial:
    """A weight, what it leads to, and its risk with the parts of it."""

    weight: float
    found: Approach
    row: dict

    @property
    def risk(self) -> float:
        return self.row["risk"]


def network_fit(
    held: StrutFrame, mesh: Mesh, solution: Solution, images: Images, nu: float
) -> tuple[Solution, dict]:
    """What meso DVC has found on the mesh as the frame would do it, and notes: the weight, and the risk
    of each that was tried and of the displacement as it was (weight 0). That stays where the weight is
    None: `refused`, a key of REFUSALS, says why. nu: Poisson's ratio."""
    q = images.reference.quadrature
    attached = Attached.of(held.frame, q.points) if len(held.frame.pieces) else None
    refused = obstacle(held, attached)
    if refused is not None:
        return as_it_was(solution, refused, [])
    project = Projection(mesh, q.points, q.weight, HOLD)
    u, near = project.at_points @ solution.u, attached.within
    reach = REACH * float(np.median(held.frame.radius))
    problem = Problem(held, attached[near], (q.points + u)[near], nu, reach)
    answers = np.stack([project.at_points @ one for one in images.answers])
    share = images.share(u, answers)
    trial = trial_of(problem, near, u, answers, lambda *given: images.risk(*given, share))
    trials = searched(problem, first_motion(held.frame, q.points[near], u[near]), trial)
    before = {"weight": 0.0} | images.risk(u, answers, share)
    rows = [before, *(one.row for one in sorted(trials, key=lambda one: one.weight))]
    best = min(trials, key=lambda one: one.risk, default=None)
    if best is None or best.risk >= before["risk"]:
        return as_it_was(solution, "unsolved" if best is None else "risk", rows)
    best = trial(best.weight, best.found.motion, FINALLY) or best
    log.info("weight %.3g: risk %.4f, %.4f without", best.weight, best.risk, before["risk"])
    change = np.zeros_like(u)
    change[near] = problem.attached.moved(best.found.motion) - problem.now
    moved = solution.u + project.nodal_change(change)
    notes = {"weight": best.weight, "trials": rows, "refused": None}
    return carried_over(solution, moved, best, images.left(project.at_points @ moved)), notes


def carried_over(solution: Solution, u: np.ndarray, best: Trial, residual: dict) -> Solution:
    """The solution with u (n, 3), as the frame would have it; it has converged where both have."""
    both = solution.converged and best.found.settled
    return replace(solution, u=u, history=best.found.steps, converged=both, residual=residual)


def obstacle(held: StrutFrame, attached: Attached | None) -> str | None:
    """What keeps the fit from being tried: a key of REFUSALS, None for nothing."""
    if attached is None or attached.within.sum() < NEAR:
        return "unseen"
    return "clamped" if held.loaded[held.frame.pieces].all() else None


def as_it_was(solution: Solution, refused: str, rows: list[dict]) -> tuple[Solution, dict]:
    """The solution, with the notes that say so."""
    log.info("the displacement stays as it is: %s", REFUSALS[refused])
    return solution, {"weight": None, "trials": rows, "refused": refused}


TrialOf = Callable[..., Trial | None]


def trial_of(
    problem: Problem,
    near: np.ndarray,
    u: np.ndarray,
    answers: np.ndarray,
    risk: Callable[[np.ndarray, np.ndarray], dict],
) -> TrialOf:
    """Tries a weight from a motion, of points `near` (Q,) the frame and others as displaced by u (Q, 3)
    with answers (d, Q, 3) to noise; None where a matrix is not positive definite."""

    def trial(weight: float, motion: FrameMotion, iterations: int = ROUND) -> Trial | None:
        found = approached(problem, motion, weight, HELD, iterations)
        if found is None:
            return None
        moved, changed = u.copy(), answers.copy()
        moved[near] += problem.attached.moved(found.motion) - problem.now
        changed[:, near] = found.left(answers[:, near])
        return Trial(weight, found, {"weight": weight} | risk(moved, changed))

    return trial


def searched(problem: Problem, motion: FrameMotion, trial: TrialOf) -> list[Trial]:
    """The trials of weights, from the first motion of the frame."""
    for weight, held in APPROACH:
        found = approached(problem, motion, weight, held, ROUND)
        if found is None:
            return []
        motion = found.motion
    trials = []
    for weight in WEIGHTS:
        one = trial(weight, trials[-1].found.motion if trials else motion)
        if one is None:
            break
        trials.append(one)
        if len(trials) > 1 and one.risk > trials[-2].risk:
            break
    if trials:
        best = min(trials, key=lambda one: one.risk)
        beside = (trial(best.weight * times, best.found.motion) for times in (1 / BETWEEN, BETWEEN))
        trials += [one for one in beside if one is not None]
    return trials
