"""A variant of micro DVC in a few figures: what is left of the images, and how rough its field is."""

import numpy as np

from addvc.analysis.validity import valid_nodes
from addvc.correlation.gauss_newton import Solution
from addvc.correlation.micro import MicroOptions
from addvc.correlation.micro_start import elastic_energy
from addvc.correlation.regularisation import shear_wave
from addvc.fem.mesh import Mesh, cell_volumes
from addvc.fem.operators import laplacian, stiffness, strain, vectorised


def settings(options: MicroOptions, threshold: float, size: float) -> dict[str, float]:
    """The value of every parameter that can be varied: voxels, grey level (threshold), nu."""
    lengths = {"l_k": options.l_k, "l_l": options.l_l, "l_e": options.l_e}
    return lengths | {"nu": options.nu, "threshold": threshold, "size": size}


def seminorms(
    mesh: Mesh, u: np.ndarray, penalised: np.ndarray, options: MicroOptions
) -> dict[str, float]:
    """What l_K, l_L and l_E hold down in u (n, 3), which is the other axis of their L-curves.

    l_k, l_l: ||D_K K u|| and ||D_L L u|| of Eq. 10 over those of the shear wave of one voxel, nan
    where no node (n,) is or all are `penalised`; l_e: root mean square elastic strain (E = 1)."""
    wave = shear_wave(mesh.points, options.axis, options.period)
    found = {}
    for name, operator, selected in (
        ("l_k", stiffness(mesh, options.nu), ~penalised),
        ("l_l", vectorised(laplacian(mesh)), penalised),
    ):
        rows = np.repeat(selected, 3)
        size, unit = (np.linalg.norm((operator @ v)[rows]) for v in (u.ravel(), wave))
        found[name] = float(size / unit) if unit > 0 else float("nan")
    energy = elastic_energy(mesh, strain(mesh, u, finite=True), options.nu)
    return found | {"l_e": float(np.sqrt(energy / cell_volumes(mesh).sum()))}


def variant_figures(
    mesh: Mesh,
    penalised: np.ndarray,
    options: MicroOptions,
    solution: Solution,
    residual: dict,
    noise: float,
) -> dict:
    """Convergence, residual (Gauss points of its own mesh), share of nodes flagged, seminorms.

    residual: of `load_residual`; noise of an image, grey levels."""
    valid = valid_nodes(np.sqrt(residual["node_square"]), noise)
    return {
        "nodes": len(mesh.points),
        "cells": len(mesh.cells),
        "iterations": solution.iterations,
        "converged": solution.converged,
        "seconds": solution.seconds,
        "residual_std": residual["statistics"]["std"],
        "flagged": float(1 - valid.mean()),
        "seminorms": seminorms(mesh, solution.u, penalised, options),
    }
