"""Where meso DVC starts from: candidates rescaled by Eq. 6, 7, and the best of them.

The best is that of least sigma(r) after a short correlation on the mesh at hand.
"""

import logging
from dataclasses import replace

import numpy as np

from addvc.correlation.gauss_newton import Solution, gauss_newton
from addvc.correlation.metric import (
    Reference,
    hessian,
    residual,
    residual_statistics,
    right_hand_side,
)
from addvc.correlation.reduced_basis import reduced_solve, scale_factors, scaling_basis
from addvc.correlation.register import Stop, System, register
from addvc.fem.assembly import node_pattern

log = logging.getLogger(__name__)

TRIAL = Stop(1e-3, 10)  # of a candidate start


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
    log.info("best start: %s", best)
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
