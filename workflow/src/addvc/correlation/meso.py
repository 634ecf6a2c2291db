"""Section 3.2: meso DVC, from a start found over a pyramid of binned images to the finest mesh.

Candidate starts: `zero` (u = 0, then the pyramid on the coarsest tetrahedra), `platens` (the pyramid
on a hexahedral grid that reaches into the platens) and those of `correlation.candidates`. Each is
rescaled on the coarsest mesh by Eq. 6, 7. On every mesh the best, by sigma(r) after a short
correlation, is kept; the finer meshes choose between the coarser solution and `correlation.candidates`.
"""

import logging
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from scipy import sparse

from addvc.correlation.clear import clear_voxels
from addvc.correlation.gauss_newton import Solution, gauss_newton
from addvc.correlation.metric import (
    Reference,
    hessian,
    reference_on,
    residual,
    residual_statistics,
    right_hand_side,
)
from addvc.correlation.reduced_basis import reduced_solve, scale_factors, scaling_basis
from addvc.correlation.register import Stop, System, register
from addvc.correlation.regularisation import diffusion
from addvc.fem.assembly import node_pattern
from addvc.fem.mesh import Mesh
from addvc.fem.operators import laplacian, vectorised
from addvc.fem.quadrature import Quadrature, lattice_points, voxel_points
from addvc.fem.solver import solver
from addvc.images.levels import displacement_to_coarse, displacement_to_fine, to_coarse
from addvc.images.spline import DEGREE

log = logging.getLogger(__name__)

TRIAL = Stop(1e-3, 10)  # of a candidate start
HOLD = 1e-2  # of the diagonal of H
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
    """A point of each voxel in tetrahedra where I_r is clear; one in stride**3 of more than `most`."""
    chosen = None
    if options.clear > 0:
        chosen = clear_voxels(coefficients, 1, options.clear, options.degree)
    stride = thinning(coefficients.size, most)
    return voxel_points(mesh, coefficients.shape, stride, chosen, dithered=True)


def thinning(voxels: int, most: float) -> int:
    """The stride that leaves at most some `most` of so many voxels."""
    return max(1, int(np.ceil((voxels / most) ** (1 / 3))))


def meso_system(
    mesh: Mesh,
    coefficients: np.ndarray,
    options: MesoOptions,
    lines: list | None = None,
    most: float = np.inf,
) -> System:
    """Eq. 9 with T = L on one mesh: I_r sampled at its voxels, and a solver of A = H + M.

    `lines` are the grid lines of a hexahedral grid."""
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


def rescale(
    reference: Reference, deformed: np.ndarray, w: np.ndarray, stop: Stop
) -> tuple[Solution, list[float]]:
    """Eq. 6, 7: the start w (n, 3) scaled along x, y, z by the image alone, and the factors.

    A scaling that raises sigma(r), or moves over 1 % of the points out of the image, is refused: w
    itself comes back, with factors of one."""
    h = hessian(reference, node_pattern(reference.mesh))

    def sigma(u):
        r, inside = residual(reference, deformed, u)
        return residual_statistics(r, inside, reference.quadrature.weight)

    def downhill(u):
        return right_hand_side(reference, residual(reference, deformed, u)[0])

    solve = reduced_solve(h, scaling_basis(w))
    solution = gauss_newton(downhill, solve, w, stop.tolerance, stop.max_iterations)
    before, after = sigma(w), sigma(solution.u)
    lost = after["outside"] > before["outside"] + 0.01 * len(reference.quadrature)
    if lost or not after["std"] <= before["std"]:
        log.info("rescale refused: sigma(r) %.3f -> %.3f", before["std"], after["std"])
        return replace(solution, u=w, residual=before, converged=False), [1.0, 1.0, 1.0]
    factors = scale_factors(solution.u, w)
    log.info(
        "rescale: factors %s, sigma(r) %.3f -> %.3f",
        np.round(factors, 4),
        before["std"],
        after["std"],
    )
    return replace(solution, residual=after), factors


def scaled_start(
    system: System, deformed: np.ndarray, candidates: dict[str, np.ndarray]
) -> tuple[str, Solution, list[dict]]:
    """The best of candidates {name: u (n, 3)} on the coarsest mesh, each rescaled first."""
    tried = {name: rescale(system.reference, deformed, u, TRIAL) for name, u in candidates.items()}
    starts = {name: solution.u for name, (solution, _) in tried.items()}
    best, solution, table = best_start(system, deformed, starts, TRIAL)
    return best, solution, [row | {"factors": tried[row["candidate"]][1]} for row in table]


def best_start(
    system: System,
    deformed: np.ndarray,
    candidates: dict[str, np.ndarray],
    stop: Stop,
) -> tuple[str, Solution, list[dict]]:
    """The candidate with the least sigma(r) after a few iterations on a mesh, and the table."""
    table, tried = [], {}
    for name, u in candidates.items():
        solution = register(system, deformed, u, stop, f"start {name}")
        tried[name] = solution
        table.append(
            {
                "candidate": name,
                "residual_std": solution.residual["std"],
                "outside": solution.residual["outside"],
                "iterations": solution.iterations,
            }
        )
    many = 0.2 * len(system.reference.quadrature)

    def rank(row):
        known = np.isfinite(row["residual_std"])
        return (not known, row["outside"] > many, row["residual_std"])

    best = min(table, key=rank)["candidate"]
    return best, tried[best], table


def chosen_register(
    system: System, deformed: np.ndarray, candidates: dict[str, np.ndarray], stop: Stop, name: str
) -> tuple[Solution, str, list[dict]]:
    """Eq. 9 on a mesh from the best of its candidates {name: u (n, 3)}; the best, and the table.

    The iterations that chose it count."""
    few = min(10, stop.max_iterations)
    best, tried, table = best_start(system, deformed, candidates, Stop(stop.tolerance, few))
    if tried.converged or few == stop.max_iterations:
        return tried, best, table
    rest = Stop(stop.tolerance, stop.max_iterations - few)
    solution = register(system, deformed, tried.u, rest, name)
    history, seconds = tried.history + solution.history, tried.seconds + solution.seconds
    return replace(solution, history=history, seconds=seconds), best, table


def meso_dvc(
    mesh: Mesh,
    images: list[np.ndarray],
    options: MesoOptions,
    fields: dict[str, Callable[[np.ndarray], np.ndarray]],
    name: str,
) -> tuple[Solution, dict]:
    """Eq. 9 on one mesh between two images, from the best of fields {name: points (n, 3) -> u}, and
    which that was with the table of all."""
    system = meso_system(mesh, images[0], options)
    starts = {start: field_(mesh.points) for start, field_ in fields.items()}
    solution, best, table = chosen_register(system, images[1], starts, options.stop, name)
    log.info("%s starts from %s", name, best)
    return solution, {"best": best, "candidates": table}
