"""Section 3.3: micro DVC on the mesh of the struts: what its two methods are made of.

`eq10` is the paper's: I_r at Gauss points, equilibrium gap, one factor of A for all states.
`corotational` adds the shell of the struts to the quadrature, robust weights, and an elastic energy
in a frame that turns with the struts (`correlation.corotational`).
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy import sparse

from addvc.config import METHODS, chooses
from addvc.correlation.corotational import BRIDGE
from addvc.correlation.cutoff import Ladder
from addvc.correlation.doubt import residual_limit
from addvc.correlation.mending import Mending
from addvc.correlation.metric import Reference, hessian, reference_on
from addvc.correlation.register import Stop, System
from addvc.correlation.regularisation import elastic_weight, equilibrium_gap
from addvc.correlation.stages import Problem, Stage, early, stage_system
from addvc.correlation.store import load_factor, load_notes, load_order
from addvc.correlation.torn import joints_of
from addvc.correlation.uncertainty import Noise
from addvc.fem.assembly import node_pattern
from addvc.fem.mesh import Mesh
from addvc.fem.operators import stiffness
from addvc.fem.quadrature import Quadrature, gauss_points
from addvc.fem.shell import joined
from addvc.images.spline import DEGREE


@dataclass(frozen=True)
class MicroOptions:
    """Cut-offs l_K, l_L (Eq. 10, 11) and l_E of the elastic energy, period T of the trial wave, all
    in voxels; Poisson's ratio nu; loading axis."""

    axis: int
    l_k: float
    l_l: float
    l_e: float
    period: float
    nu: float = 0.28


def micro_options(section: dict, cell_size: float, axis: int) -> MicroOptions:
    """Options from the `micro` section of a configuration.

    "auto" of l_K and l_L: two cell sizes, at most 1.6 periods. The paper takes l_K = 1.25 cell
    sizes, the shortest that converged. On the twin, whose lattice mesh is finer, 1 / 1.4 / 2 cell
    sizes give median errors of .13 / .10 / .09 voxel at 3.4 %. Where a cell has many voxels
    (trabecular bone: 84) the noise, not the cell, asks for smoothing, and less of it: 20 / 56 / 168
    voxels gave .06 / .10 / .22 voxel on a wavy field. "auto" of l_E: 0.8 cell size, at most 0.7
    periods, to begin with: the images then choose (`ladder`). `times`, where given: factors on some
    of them (`addvc.studies`)."""
    longest = min(2 * cell_size, 1.6 * section["period"])
    auto = {"l_k": longest, "l_l": longest, "l_e": min(0.8 * cell_size, 0.7 * section["period"])}
    times = section.get("times", {})
    lengths = {
        key: times.get(key, 1.0) * (value if section[key] == "auto" else float(section[key]))
        for key, value in auto.items()
    }
    return MicroOptions(axis=axis, **lengths, period=float(section["period"]), nu=section["nu"])


def micro_reference(
    mesh: Mesh, coefficients: np.ndarray, shell: Quadrature | None = None, degree: int = DEGREE
) -> Reference:
    """I_r, by its spline coefficients (nx, ny, nz), at the four Gauss points of each of m tetrahedra,
    then at the s points of a shell, if any: Q = 4 m + s."""
    points = gauss_points(mesh) if shell is None else joined(gauss_points(mesh), shell)
    return reference_on(mesh, points, coefficients, degree)


def eq10(
    reference: Reference, penalised: np.ndarray, options: MicroOptions
) -> tuple[sparse.csr_matrix, sparse.csr_matrix, dict]:
    """Eq. 10 multiplied through by S(v): A = H + M, M, and the weights c1, c2."""
    h = hessian(reference, node_pattern(reference.mesh)).tocsr()
    extra, weights = equilibrium_gap(
        reference.mesh,
        h,
        penalised,
        options.l_k,
        options.l_l,
        options.period,
        options.nu,
        options.axis,
    )
    return h + extra, extra, weights


def elastic(
    reference: Reference, options: MicroOptions
) -> tuple[sparse.csr_matrix, sparse.csr_matrix, dict]:
    """The same with an elastic energy: A = H + c K, c K, and the weight c, before any turning."""
    pattern = node_pattern(reference.mesh)
    h, k = hessian(reference, pattern).tocsr(), stiffness(reference.mesh, options.nu, pattern)
    c = elastic_weight(reference.mesh, h, k, options.l_e, options.period, options.axis)
    extra = (c * k).tocsr()
    return h + extra, extra, {"c": c, "l_e": options.l_e}


def problem_of(
    reference: Reference, notes: dict, nu: float, order: np.ndarray, bridges: list[dict]
) -> Problem:
    """The problem of `elastic`, from the notes and the order that were stored with its factor, with the
    rows of bridges.json."""
    joints = joints_of(reference.mesh, bridges)
    return Problem(reference, notes["c"], nu, notes["l_e"], order, joints=joints)


def system_at_rest(
    reference: Reference,
    method: str,
    nu: float,
    factor: str | Path,
    solution: str | Path | None,
    bridges: list[dict],
) -> System:
    """The system of a method before any turning, from what `factor` holds and the rows of bridges.json;
    with the weight of the elastic energy, and the bridges cut, that `solution` ended with, if any."""
    if METHODS[method].gap:
        known, extra, _ = load_factor(factor)
        return System(reference, extra, known)
    order, notes = load_order(factor)
    problem = problem_of(reference, notes, nu, order, bridges)
    if solution is not None:
        notes = load_notes(solution)
        cuts = [joint for joint in problem.joints if joint.position in notes["torn"]]
        problem = replace(problem, weight=notes["c"], bridge=BRIDGE).tear(cuts)
    return stage_system(problem, Stage(rotated=False), None)


def shell_of(method: str, shell: Quadrature) -> Quadrature | None:
    """The shell where a method has one."""
    return shell if METHODS[method].shell else None


def robust_scale(setting: str | float, levels: dict) -> float | None:
    """Scale of the robust weights (grey levels), None for least squares ("none").

    "auto": twelve times the noise of the splines, at least a third of the contrast between void and
    solid. Half, once or twice as much changed the rms error by less than 0.003 voxel (twin, 3.4 and
    12.3 %)."""
    if setting == "none":
        return None
    if setting == "auto":
        return float(max(12 * levels["noise_at_points"], (levels["solid"] - levels["void"]) / 3))
    return float(setting)


def turns(section: dict, method: str) -> bool:
    """Whether the frame of a method turns with the struts; `section`: `micro` of a configuration."""
    return bool(section["rotated"]) and METHODS[method].rotation


def stages(section: dict, levels: dict, method: str = "corotational") -> list[Stage]:
    """Stages of micro DVC from the `micro` section of a configuration and the grey `levels` of the
    threshold (void, solid, noise); all but the last end early (`correlation.stages.early`)."""
    rotated = turns(section, method)
    scale = robust_scale(section["robust"], levels) if METHODS[method].robust else None
    last = Stop(section["tolerance"], section["max_iterations"])
    ends = [early(last)] * (section["stages"] - 1) + [last]
    return [Stage(rotated, scale, end) for end in ends]


def ladder(section: dict, levels: dict, blur: float, method: str) -> Ladder | None:
    """What l_E is chosen from, from the `micro` section and the noise of the grey `levels` after the
    pre-filter `blur` (voxels); None where it is given, or there is no stage to choose it in."""
    return Ladder(Noise(levels["noise"], blur)) if chooses(section, method) else None


def mending(section: dict, levels: dict) -> Mending | None:
    """Cycles of mending from the `micro` section, None for 0, the limit from the noise of the grey
    `levels`."""
    if section["mending"] == 0:
        return None
    return Mending(section["mending"], residual_limit(levels["noise_at_points"]))


def plan(
    section: dict, levels: dict, blur: float, method: str = "corotational"
) -> tuple[list[Stage], Mending | None, Ladder | None]:
    """What `corotational` does by a method: its stages, their mending, the choice of l_E."""
    found = mending(section, levels), ladder(section, levels, blur, method)
    return stages(section, levels, method), *found
