"""Mending of struts that went astray, between the stages of `corotational`.

At large strain a few struts start too far off and fall into the wrong minimum: their residual tells.
`mend` lets go of them: without their points they go where the struts they hang on carry them, then
look at the image again, with wider weights first; bridges that do not hold are cut (`torn`). What is
still in doubt does not count in the last stage, which then settles. On the twin at 28.5 % (seed 2417)
two cycles bring the rms error from 1.37 to .16 voxel, nodes within 1 voxel from 98.45 to 99.91 %; two
more change nothing.
"""

import logging
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from addvc.correlation.doubt import doubtful_nodes, without
from addvc.correlation.metric import Reference
from addvc.correlation.stages import Problem, Stage, Step, early, run
from addvc.correlation.torn import (
    APART,
    BETTER,
    Joint,
    apart,
    layers,
    misfit_near,
    torn_joints,
)

log = logging.getLogger(__name__)

HELPED = 0.99
"""Share of the nodes in doubt, over that before, that a cycle of mending leaves where it was of use."""


@dataclass(frozen=True)
class Mending:
    """How often struts are let go, and from which rms residual on (grey levels); the share of the
    nodes below which that is not worth a cycle, and above which it is not a few struts that went
    astray but the model that does not fit: where every strut moves on its own (benchmarks, `strut`), a
    quarter of the nodes was let go, and the error rose from .54 to .79 voxel."""

    cycles: int
    limit: float
    least: float = 1e-3
    most: float = 0.15


def trusted(
    reference: Reference, deformed: np.ndarray, u: np.ndarray, mending: Mending
) -> Reference:
    """The points less those of what is in doubt, where that is not too much to be a few struts."""
    doubtful = doubtful_nodes(reference, deformed, u, mending.limit)
    if doubtful.mean() >= mending.most:
        log.info(
            "micro DVC: %.0f %% of the nodes are in doubt (at most %.0f %% are left out): none is",
            100 * doubtful.mean(),
            100 * mending.most,
        )
        return reference
    return without(reference, doubtful)


def mend(
    problem: Problem, deformed: np.ndarray, u: np.ndarray, last: Stage, mending: Mending
) -> tuple[Problem, list[Step]]:
    """The problem, its torn bridges cut if there are any, and the stages of all cycles of mending from
    u (n, 3). A cycle that leaves as much in doubt as the one before is the last: contacts are in doubt,
    and right."""
    done: list[Step] = []
    cuts: list[Joint] = []
    most, whole = mending.most, problem
    for _ in range(mending.cycles):
        doubtful = doubtful_nodes(problem.reference, deformed, u, mending.limit)
        if not mending.least <= doubtful.mean() < most:
            break
        most = HELPED * doubtful.mean()
        log.info("micro DVC: %.2f %% of the nodes are let go", 100 * doubtful.mean())
        carry = partial(carried, deformed=deformed, u=u, last=last, doubtful=doubtful)
        if done:
            steps = carry(problem)
        else:
            cuts, steps = helpful_cuts(problem, deformed, carry, last.scale, mending.limit)
            problem = whole.tear(cuts)
        done += steps + seen_again(problem, deformed, steps[-1][0].u, last)
        u = done[-1][0].u
        cuts = [joint for joint in cuts if apart(joint, u) > APART]
        problem = whole.tear(cuts)
    return problem, done


def carried(
    problem: Problem, deformed: np.ndarray, u: np.ndarray, last: Stage, doubtful: np.ndarray
) -> list[Step]:
    """Two stages from u (n, 3) without the points of doubtful nodes (n,), which the struts that they
    hang on carry."""
    stage = replace(last, stop=early(last.stop))
    given = replace(problem, reference=without(problem.reference, doubtful))
    first = run(given, stage, deformed, u, "carried")
    return [first, run(given, stage, deformed, first[0].u, "carried")]


def seen_again(problem: Problem, deformed: np.ndarray, u: np.ndarray, last: Stage) -> list[Step]:
    """Two stages from u (n, 3) with all points, of wide weights, then of those of the last stage."""
    narrow = replace(last, stop=early(last.stop))
    wide = replace(narrow, scale=None if last.scale is None else 2 * last.scale)
    first = run(problem, wide, deformed, u, "wide")
    return [first, run(problem, narrow, deformed, first[0].u, "narrow")]


def helpful_cuts(
    problem: Problem,
    deformed: np.ndarray,
    carry: Callable[[Problem], list[Step]],
    scale: float | None,
    limit: float,
) -> tuple[list[Joint], list[Step]]:
    """The bridges to cut, and the stages that `carry` what is in doubt with them cut; none, and those of
    the problem as it is, unless cuts explain the images near them better.

    On trial are the bridges still in doubt (over `limit`, grey levels) once carried whole. What is not
    taken leaves no trace in the history."""
    mesh, whole = problem.reference.mesh, carry(problem)
    still = doubtful_nodes(problem.reference, deformed, whole[-1][0].u, limit)
    cuts = torn_joints(mesh, problem.joints, still)
    if not cuts:
        return [], whole
    cut = problem.tear(cuts)
    steps = carry(cut)
    before, after = (
        misfit_near(cut.reference, deformed, way[-1][0].u, layers(cuts), scale)
        for way in (whole, steps)
    )
    taken = after < BETTER * before
    words = "micro DVC: misfit near %d bridges in doubt %.3f, cut %.3f grey levels^2: %s"
    log.info(words, len(cuts), before, after, "torn" if taken else "whole")
    return (cuts, steps) if taken else ([], whole)
