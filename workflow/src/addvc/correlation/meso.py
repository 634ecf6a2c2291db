"""Section 3.2: meso DVC, from a start found over a pyramid of binned images to the finest mesh.

Candidate starts: `zero` (u = 0, then the pyramid on the coarsest tetrahedra), `platens` (the pyramid
on a hexahedral grid that reaches into the platens) and those of `correlation.candidates`. Each is
rescaled on the coarsest mesh by Eq. 6, 7. On every mesh the best is kept (`correlation.meso_start`);
the finer meshes choose between the coarser solution and `correlation.candidates`.

The cut-off l_L of the Laplacian is then chosen anew, state by state, as l_E of micro DVC is
(`correlation.cutoff`), from what 0.6 of the edge has led to: at small strain noise counts, at large
strain what the Laplacian smoothes away. A choice from which Gauss-Newton does not settle is dropped.
"""

import logging
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from scipy import sparse

from addvc.correlation.clear import clear_voxels, thinning
from addvc.correlation.cutoff import RATIO, Ladder, least_risk, trial_of
from addvc.correlation.gauss_newton import Solution
from addvc.correlation.meso_start import chosen_register
from addvc.correlation.metric import hessian, reference_on
from addvc.correlation.register import Stop, System, register
from addvc.correlation.regularisation import diffusion
from addvc.correlation.uncertainty import Noise
from addvc.fem.assembly import node_pattern
from addvc.fem.mesh import Mesh
from addvc.fem.operators import laplacian, vectorised
from addvc.fem.quadrature import Quadrature, lattice_points, voxel_points
from addvc.fem.solver import solver
from addvc.images.levels import displacement_to_coarse, displacement_to_fine, to_coarse
from addvc.images.spline import DEGREE

log = logging.getLogger(__name__)

HOLD = 1e-2  # of the diagonal of H
SHORTEST = -2
"""Of the ladder of l_L: on shorter rungs, which the images of large strains ask for, the least risk is
that of a mesh that follows single struts (default twin: the error of meso 12 at 12.3 % is .466 voxel
with 0.6 of the edge, .375 here, .385 three rungs on)."""

ONCE_MORE = 30  # iterations with another l_L, at most
START_VOXELS = 2e6  # a start is coarse: more voxels would take memory and give nothing


@dataclass(frozen=True)
class MesoOptions:
    """Lengths in voxels: cut-off l_L of Eq. 9 (0 for none) and period T of its trial wave; only voxels
    take part whose gradient exceeds `clear` times the noise (0: all); degree of the splines."""

    axis: int
    cutoff: float
    period: float
    stop: Stop = field(default_factory=Stop)
    clear: float = 0.0
    degree: int = DEGREE


def meso_options(
    section: dict, size: float, axis: int, coarsest: bool, degree: int = DEGREE
) -> MesoOptions:
    """Options of one mesh of mean edge `size` from the `meso` section of a configuration.

    The coarsest mesh is regularised by its elements alone. The paper's cut-off of some 35 voxels
    on the others smooths more than its elements do: on the twin meso 23 then is worse than meso 33.
    0.6 of the edge keeps the system regular and falls from mesh to mesh."""
    cutoff = 0.6 * size if section["l_l"] == "auto" else float(section["l_l"])
    stop = Stop(section["tolerance"], section["max_iterations"])
    return MesoOptions(axis, 0.0 if coarsest else cutoff, 4 * size, stop, section["clear"], degree)


def start_options(section: dict, size: float, axis: int, degree: int = DEGREE) -> MesoOptions:
    """Options of the pyramid: a loose criterion, and a Laplacian of one element on every level."""
    stop = Stop(1e-2, section["max_iterations"])
    return MesoOptions(axis, size, 4 * size, stop, degree=degree)


def meso_quadrature(
    mesh: Mesh, coefficients: np.ndarray, options: MesoOptions, most: float = np.inf
) -> Quadrature:
    """A point of each voxel in tetrahedra where I_r, by its spline coefficients (nx, ny, nz), is clear;
    one in stride**3 of an image of more than `most` voxels, which weighs as many.

    Raises CorrelationError where clear voxels are sought in a blank image, MeshError where no voxel
    is left."""
    chosen = None
    if options.clear > 0:
        chosen = clear_voxels(coefficients, 1, options.clear, options.degree)
    stride = thinning(coefficients.size, most)
    return voxel_points(mesh, coefficients.shape, stride, chosen, dithered=True)


def meso_system(
    mesh: Mesh,
    coefficients: np.ndarray,
    options: MesoOptions,
    lines: list | None = None,
    most: float = np.inf,
) -> System:
    """Eq. 9 with T = L on one mesh of n nodes: I_r, by its spline coefficients (nx, ny, nz), sampled at
    its voxels (Q,), and a solver of A = H + M (3 n, 3 n).

    `lines`: coordinates (k,), voxels, of the grid lines along x, y and z of a hexahedral grid, None for
    tetrahedra; `most`: voxels from which on some are left out. Raises CorrelationError where A is not
    positive definite, else as `meso_quadrature` does."""
    if lines is None:
        quadrature = meso_quadrature(mesh, coefficients, options, most)
    else:
        stride = thinning(coefficients.size, most)
        quadrature = lattice_points(lines, coefficients.shape, stride)
    reference = reference_on(mesh, quadrature, coefficients, options.degree)
    h = hessian(reference, node_pattern(mesh))
    if options.cutoff == 0:
        return System(reference, None, solver(h + held(mesh, h)))
    extra = diffusion(mesh, h, options.cutoff, options.period, options.axis)
    return System(reference, extra, solver(h + extra))


def held(mesh: Mesh, h: sparse.bsr_matrix) -> sparse.spmatrix:
    """A Laplacian so weak that it only holds nodes with hardly a voxel that counts around them. It
    damps steps: A has it, the functional has not.

    It moves meso 33 of the default twin by .002 voxel at 28.5 % and less before; with a ten-
    thousandth of it the corners of a box of foam 96 voxels wide, which one strut touches, drift for
    100 iterations."""
    operator = vectorised(laplacian(mesh))
    return operator * (HOLD * h.diagonal().mean() / operator.diagonal().mean())


def pyramid_start(
    mesh: Mesh,
    references: list[np.ndarray],
    deformed: list[np.ndarray],
    options: MesoOptions,
    lines: list[np.ndarray] | None = None,
) -> np.ndarray:
    """u (n, 3) by a fold over levels, coarse to fine; level l is binned by 2**l (`levels.pyramid`).

    At level l the mesh, the displacement and the lengths of the regularisation are 2**l shorter."""
    u = np.zeros_like(mesh.points)
    for level in reversed(range(len(references))):
        factor = 2**level
        small = Mesh(to_coarse(mesh.points, factor), mesh.cells)
        grid = None if lines is None else [to_coarse(line, factor) for line in lines]
        scaled = replace(options, cutoff=options.cutoff / factor, period=options.period / factor)
        system = meso_system(small, references[level], scaled, grid, START_VOXELS)
        solution = register(
            system,
            deformed[level],
            displacement_to_coarse(u, factor),
            options.stop,
            f"pyramid level {level}",
        )
        u = displacement_to_fine(solution.u, factor)
    return u


def cutoff_ladder(section: dict, levels: dict, blur: float) -> Ladder | None:
    """What l_L is chosen from, from the `meso` section and the noise of the grey `levels` after the
    pre-filter `blur` (voxels); None where it is given."""
    if section["l_l"] != "auto":
        return None
    return Ladder(Noise(levels["noise"], blur), shortest=SHORTEST)


def meso_dvc(
    mesh: Mesh,
    images: list[np.ndarray],
    options: MesoOptions,
    fields: dict[str, Callable[[np.ndarray], np.ndarray]],
    name: str,
    ladder: Ladder | None = None,
) -> tuple[Solution, dict]:
    """Eq. 9 on one mesh between two images, from the best of fields {name: points (n, 3) -> u}, and
    notes: which that was with the table of all, l_L in the end, the trials of `ladder` (None: l_L
    stays what it is)."""
    system = meso_system(mesh, images[0], options)
    starts = {start: field_(mesh.points) for start, field_ in fields.items()}
    solution, best, table = chosen_register(system, images[1], starts, options.stop, name)
    log.info("%s starts from %s", name, best)
    times, trials = 1.0, []
    if ladder is not None and system.regularisation is not None and solution.converged:
        solution, times, trials = with_cutoff(system, images[1], solution, ladder, options.stop)
    length = options.cutoff * times
    trials = [row | {"l_l": row["times"] * options.cutoff} for row in trials]
    return solution, {"best": best, "candidates": table, "l_l": length, "risk": trials}


def with_cutoff(
    system: System, deformed: np.ndarray, solution: Solution, ladder: Ladder, stop: Stop
) -> tuple[Solution, float, list[dict]]:
    """The solution with the l_L of least risk, from that of a system; l_L over the system's; the trials.

    Where the loop does not settle, the solution that was there and 1."""
    rung, trials = least_risk(trial_of(system, deformed, solution.u, ladder), ladder, 0)
    if rung == 0:
        return solution, 1.0, trials
    times = RATIO**rung
    stop = replace(stop, max_iterations=min(ONCE_MORE, stop.max_iterations))
    found = register(cut_off(system, times), deformed, solution.u, stop, f"l_L times {times:.2g}")
    if not found.converged:
        return solution, 1.0, trials
    history, seconds = solution.history + found.history, solution.seconds + found.seconds
    return replace(found, history=history, seconds=seconds), times, trials


def cut_off(system: System, times: float) -> System:
    """The system with `times` the cut-off: the Laplacian goes with its square."""
    extra = times**2 * system.regularisation
    h = hessian(system.reference, node_pattern(system.reference.mesh))
    return replace(system, regularisation=extra, factor=solver(h + extra))
