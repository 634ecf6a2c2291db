"""The network fit: what meso DVC has found, as struts that hardly need loads would do it.

A mesh of 12 voxels lets the noise of every element into its displacement, and a Laplacian that keeps it
out keeps the bending of the struts out too. The struts themselves tell both apart: of the motions of
their frame near equilibrium (`correlation.frame_fit`) that one is found which follows the displacement
at points of the micro mesh, robustly, since meso DVC may have put struts in the place of
others; and, of the fields of the mesh, the one that is nearest to it.

How much equilibrium weighs, and whether the frame helps at all, the images choose as they do the l_L of
the mesh (`correlation.cutoff`), by Stein's unbiased risk

    risk(w) = sum rho(r_w) + 2 E[sum n grad I_r . u_w(n)],

r_w the residual of the motion with the weight w, n that of noise alone, and u_w(n) what meso DVC and the
fit make of it. No truth and no micro DVC is needed; where no weight has a smaller risk than the
displacement as it is, that stays.
"""

import logging
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from addvc.correlation.frame_fit import HELD, Approach, Problem, approached
from addvc.correlation.gauss_newton import Solution
from addvc.correlation.metric import (
    Reference,
    reference_on,
    residual_at,
    residual_statistics,
    right_hand_side,
    robust_square,
)
from addvc.correlation.register import System
from addvc.correlation.transfer import Projection
from addvc.correlation.uncertainty import SEED, Noise
from addvc.fem.carried import NEAR, Attached, first_motion
from addvc.fem.frame import FrameMotion
from addvc.fem.mesh import Mesh
from addvc.fem.quadrature import gauss_points, thinned
from addvc.geometry.strut_frame import StrutFrame
from addvc.images.spline import spline_value

log = logging.getLogger(__name__)

POINTS = 60_000
"""Tetrahedra of the micro mesh that the fit takes, by their middles, about: 25 for each node of the
frame of the default twin. With a fourth of them errors are 2 % larger."""

DRAWS = 2

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
class Images:
    """What a displacement is judged by: I_r at points (Q,) of the struts, I_d by its spline coefficients
    (nx, ny, nz), the scale of the residuals (grey levels; None: plain squares), and draws of the noise:
    residuals (d, Q) with the displacements (d, n, 3) that meso DVC makes of them."""

    reference: Reference
    deformed: np.ndarray
    scale: float | None
    noise: np.ndarray
    answers: np.ndarray

    def risk(self, u: np.ndarray, answers: np.ndarray) -> dict:
        """Risk of displacements u (Q, 3) that noise changes by answers (d, Q, 3), grey levels^2, less
        its constant, and its two parts. A point outside of I_d costs as much as one on a wrong strut."""
        at, weight = self.reference, self.reference.quadrature.weight
        r, inside = residual_at(at, self.deformed, u)
        worst = self.scale**2 if self.scale is not None else np.ptp(at.grey) ** 2
        fit = weight @ np.where(inside, robust_square(r, self.scale), worst) / weight.sum()
        along = np.einsum("qi,dqi->dq", at.gradient, answers)
        freedom = 2 * np.mean((self.noise * along) @ weight) / weight.sum()
        return {"risk": float(fit + freedom), "misfit": float(fit), "freedom": float(freedom)}

    def left(self, u: np.ndarray) -> dict:
        """Statistics of the residual under u (Q, 3)."""
        r, inside = residual_at(self.reference, self.deformed, u)
        return residual_statistics(r, inside, self.reference.quadrature.weight)


def images_of(
    micro: Mesh, images: list[np.ndarray], system: System, scale: float | None, noise: Noise
) -> Images:
    """What a displacement by the `system` of meso DVC is judged by, of [I_r, I_d] by their spline
    coefficients with the noise of each, in the middle of some tetrahedra of the micro mesh."""
    degree = system.reference.degree
    reference = reference_on(micro, thinned(gauss_points(micro, 1), POINTS), images[0], degree)
    rng, residuals, answers = np.random.default_rng(SEED), [], []
    for _ in range(DRAWS):
        volume = np.sqrt(2) * noise.volume(images[0].shape, rng)
        r = spline_value(volume, system.reference.quadrature.points, degree)[0]
        right = right_hand_side(system.reference, np.where(system.reference.inside, r, 0))
        answers.append(system.factor.solve(right).reshape(-1, 3))
        residuals.append(spline_value(volume, reference.quadrature.points, degree)[0])
    return Images(reference, images[1], scale, np.stack(residuals), np.stack(answers))


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
    trial = trial_of(problem, near, u, answers, images)
    trials = searched(problem, first_motion(held.frame, q.points[near], u[near]), trial)
    before = {"weight": 0.0} | images.risk(u, answers)
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
    problem: Problem, near: np.ndarray, u: np.ndarray, answers: np.ndarray, images: Images
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
        return Trial(weight, found, {"weight": weight} | images.risk(moved, changed))

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
