"""What struts are measured on: the displacement in equilibrium, or why it is left as measured.

`frame_filter` finds the motion of the frame; here it is carried along to the nodes of the mesh, with
draws of the noise, where the filter can be trusted.
"""

import logging

import numpy as np

from addvc.analysis.frame_filter import DOUBTED, Fit, best_fit
from addvc.analysis.strut_table import RAW, Measured
from addvc.correlation.frame_fit import Problem, mean_square
from addvc.fem.carried import NEAR, Attached, first_motion
from addvc.geometry.strut_frame import StrutFrame

log = logging.getLogger(__name__)

FEW = 4
"""Draws that choose the weight: each is a sum over all nodes."""

CARRYING = 0.5
"""Share of the nodes of the frame that valid nodes of the mesh must be nearest to: of fewer, what was
not seen decides."""

REFUSALS = {
    "clamped": "the frame has no node, of {frame_nodes}, that is free of loads from outside (at least "
    "1), so that nothing is in equilibrium; widen micro.region",
    "unseen": "{carrying:.0%} of the nodes of the frame carry valid nodes of the mesh, {nodes} in all "
    f"(at least {CARRYING:.0%}, over {NEAR}), so that the rest would decide; see Fig. 13 for "
    "where nodes are in doubt; lower mesh.size, or set mesh.mend: bridge where the mesh lacks struts",
    "noiseless": "the draws of the noise are zero (over 0 voxel), so that nothing can be told from "
    "noise; this is right for images without noise only: of others, check geometry/threshold.json",
    "unsettled": "no motion of the frame was found, with any weight; the start is far off: see Fig. 13 "
    "for where, and raise micro.mending",
    "harm": "the misfit of the best equilibrium is {misfit:.3f} voxel (at most {bound:.3f}), over "
    f"which it does more harm than good even if noise were {DOUBTED:g} times what is expected: struts "
    "hinge, touch, or were lost; see Fig. 13 for where, and raise micro.mending if they were lost",
}
"""Why struts are left as measured: value, limit, remedy."""


def refusal(notes: dict) -> str | None:
    """Why struts are as measured, from the notes of `balanced`; None where they are not."""
    return REFUSALS[notes["refused"]].format(**notes) if notes.get("refused") else None


def balanced(
    held: StrutFrame, measured: Measured, valid: np.ndarray, nu: float
) -> tuple[Measured, dict]:
    """What was measured, with its draws of the noise, as the frame moves it at nodes within its reach,
    by those that are `valid` (n,); nothing changes where no motion is found that helps. Notes: the
    weight, the rms misfit, by how much it exceeds what the noise at rest explains (the draws are scaled
    up so that it does explain it), the share of the noise that is left, the share of the frame that was
    seen; with a weight of None, why the filter is `refused`, a key of REFUSALS."""
    attached = Attached.of(held.frame, measured.points) if len(held.frame.pieces) else None
    use = np.zeros(len(valid), bool) if attached is None else attached.within & (valid > 0)
    share = len(np.unique(attached.ends[use])) / len(held.frame.points) if use.any() else 0.0
    notes = {"weight": None, "carrying": share, "nodes": int(use.sum()),
             "frame_nodes": len(held.frame.points)}  # fmt: skip
    draws = measured.draws[:, use]
    notes["refused"], fit = obstacle(held, draws, notes), None
    if notes["refused"] is None:
        points, u = measured.points[use], measured.u[use]
        problem = Problem(held, attached[use], points + u, nu)
        fit = best_fit(problem, first_motion(held.frame, points, u), draws[:FEW])
        notes |= figures(fit)
    if notes["refused"] is not None:
        log.warning("WARNING: struts are as measured: %s", refusal(notes))
        return measured, notes
    return carried_along(fit, draws, attached, measured), notes


def obstacle(held: StrutFrame, draws: np.ndarray, notes: dict) -> str | None:
    """What keeps the filter from being tried: a key of REFUSALS, None for nothing."""
    if held.loaded[held.frame.pieces].all():
        return "clamped"
    if notes["carrying"] < CARRYING or notes["nodes"] <= NEAR:
        return "unseen"
    return "noiseless" if mean_square(draws[:FEW]) == 0 else None


def figures(fit: Fit | None) -> dict:
    """Notes of a fit."""
    if fit is None:
        return {"refused": "unsettled"}
    found = {"misfit": fit.misfit**0.5, "bound": fit.bound**0.5, "misfit_over_noise": fit.excess}
    if not fit.helps:
        return found | {"refused": "harm"}
    return found | {"weight": float(fit.weight), "noise_left": fit.kept**0.5}


def carried_along(fit: Fit, draws: np.ndarray, attached: Attached, measured: Measured) -> Measured:
    """The motion of a fit at all nodes within reach of the frame, and what it leaves of draws (d, k, 3)
    of the noise at those that it was found from."""
    near = attached.within
    u, left, own = measured.u.copy(), measured.draws.copy(), attached[near]
    u[near] = own.moved(fit.motion) - measured.points[near]
    left[:, near] = fit.excess * fit.left(draws, own.slopes(fit.motion))
    return Measured(measured.points, u, left)


def micro_fields(
    held: StrutFrame | None, measured: Measured, valid: np.ndarray, nu: float
) -> tuple[dict[str, Measured], dict | None]:
    """What struts are measured on, by the ending of its columns, and the notes of `balanced`; the
    measured displacement alone where there is no frame."""
    if held is None:
        return {"": measured}, None
    filtered_field, notes = balanced(held, measured, valid, nu)
    return {"": filtered_field, RAW: measured}, notes
