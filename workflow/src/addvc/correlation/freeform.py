"""Free-form DVC: a displacement on a cubic B-spline grid, found without a start, coarse to fine.

No mesh and no mechanics: the grid covers the whole image with what it shows of the platens, whose
faces in both images give the affine field to begin with. Each level has a grid and a blur. The
functional gets the bending energy of the grid, weighted by a cut-off length on a shear wave of four
spacings, as in Eq. 11.
"""

import logging
import time
from dataclasses import dataclass, replace

import numpy as np

from addvc.correlation.clear import thinning
from addvc.correlation.gauss_newton import Solution, rms
from addvc.correlation.regularisation import shear_wave, tikhonov_weight
from addvc.correlation.spline_grid import SplineGrid, grid_over, refine
from addvc.correlation.spline_metric import (
    Sampling,
    hessian,
    linearise,
    right_hand_side,
    sample,
    statistics,
)
from addvc.correlation.spline_stencil import (
    add_scalar,
    bending,
    conjugate_gradient,
    scalar_product,
    stencil_product,
)
from addvc.images.platens import moved_faces
from addvc.images.spline import DEGREE, gaussian_blur

log = logging.getLogger(__name__)

MOST = 3e7
"""Voxels of an image of which each may take part on the last level; of more, one in eight or fewer. At
504 x 551 x 507 voxels 2.2 million clear ones are left of 29; it takes 7.7 GB and 157 CPU-s."""

ROOM = 150
"""Voxels of the image for a control point, at least: one takes 12 kB, the images 8 bytes a voxel, and
the workflow declares ten times as much as these. A spacing that asks for more points stays twice as
large."""

ALWAYS = 100_000
"""Control points that there is room for in any image."""

NOMINAL_CELL = 28.0  # voxels: the cell size that LEVELS is written for


@dataclass(frozen=True)
class Level:
    """spacing, blur and cut-off length in voxels; every `stride`-th voxel whose gradient exceeds
    `clear` times its noise; most Gauss-Newton iterations, and the rms(du) in voxels that ends them;
    accuracy and most steps of their solver."""

    spacing: float
    blur: float
    cutoff: float
    stride: int
    clear: float
    iterations: int
    tolerance: float = 1e-2
    accuracy: float = 3e-2
    most: int = 40


# Coarse levels to 0.01, fine ones to the last iteration, solvers to 0.01 in 200 steps: the rms error
# on the twin was the same to .001 voxel (.006 at 28.5 %), in 2.4 times as long.
LEVELS = (
    Level(32, 3.0, 16, 2, 4, 6),
    Level(16, 3.0, 10, 2, 4, 10, 0.02),
    Level(16, 2.0, 10, 2, 6, 10, 0.02),
    Level(8, 1.5, 6, 2, 6, 6, 0.1, most=30),
    Level(8, 0.0, 6, 1, 8, 5, 0.1, most=30),
)


@dataclass(frozen=True)
class FreeformOptions:
    """Loading axis; levels from coarse to fine; the rms(du) in voxels below which the last level has
    settled: a start needs no more; degree of the splines of the images (those of u are cubic)."""

    axis: int
    levels: tuple[Level, ...] = LEVELS
    settled: float = 0.1
    degree: int = DEGREE


def freeform_options(
    section: dict, cell_size: float, axis: int, degree: int = DEGREE
) -> FreeformOptions:
    """LEVELS scaled to the finest spacing of the `freeform` section: auto is 8 for cells of 28.

    The last level is not thinned out, whatever the cell size."""
    nominal = LEVELS[-1].spacing
    auto = nominal * cell_size / NOMINAL_CELL
    scale = (auto if section["spacing"] == "auto" else section["spacing"]) / nominal
    levels = tuple(scaled(level, scale) for level in LEVELS)
    return FreeformOptions(axis, levels, degree=degree)


def scaled(level: Level, scale: float) -> Level:
    """A level for cells `scale` times larger."""
    lengths = {key: getattr(level, key) * scale for key in ("spacing", "blur", "cutoff")}
    stride = 1 if level.stride == 1 else max(1, round(level.stride * scale))
    return replace(level, stride=stride, **lengths)


def bending_weight(
    grid: SplineGrid, h: np.ndarray, energy: np.ndarray, cutoff: float, axis: int
) -> float:
    """(l / T)**4 S(v) / (v^T B v), T being four spacings: Eq. 11 for the bending energy."""
    period = 4 * grid.spacing
    points = grid.control_points()
    v = shear_wave(points.reshape(-1, 3), axis, period).reshape(points.shape)
    trial = np.sum(v * stencil_product(h, v)) / np.sum(v * scalar_product(energy, v))
    return tikhonov_weight(cutoff, period) * float(trial)


def affine_start(
    grid: SplineGrid, reference: np.ndarray, deformed: np.ndarray, axis: int
) -> np.ndarray:
    """Coefficients (nx, ny, nz, 3) of the compression between the platens seen in both images, rigid
    beyond their faces; an end of the images where neither shows a platen is held; zero where they do
    not show the same platens."""
    points = grid.control_points()
    u = np.zeros_like(points)
    faces = moved_faces(reference, deformed, axis)
    if faces is None:
        log.info("free-form: the images do not show the same platens, from rest")
        return u
    before, after = faces
    log.info("free-form: platens from %s to %s voxels", np.round(before, 2), np.round(after, 2))
    between = np.clip(points[..., axis], *before)
    u[..., axis] = np.interp(between, before, np.subtract(after, before))
    return u


def register_level(
    sampling: Sampling, deformed: np.ndarray, p: np.ndarray, level: Level, options: FreeformOptions
) -> Solution:
    """Gauss-Newton on one level, H anew at each step; u of the solution holds the coefficients p."""
    grid, history, start = sampling.grid, [], time.perf_counter()
    energy, weight, u = bending(grid), None, sampling.displacement(p)
    for _ in range(level.iterations):
        r, slope, _ = linearise(sampling, deformed, u)
        h = hessian(sampling, slope)
        if weight is None:
            weight = bending_weight(grid, h, energy, level.cutoff, options.axis)
        b = right_hand_side(sampling, r, slope) - weight * scalar_product(energy, p)
        add_scalar(h, energy, weight)
        step, _ = conjugate_gradient(h, b, level.accuracy, level.most)
        du = sampling.displacement(step)
        history.append(rms(du))
        if not np.isfinite(history[-1]):
            break
        p, u = p + step, u + du
        if history[-1] < level.tolerance:
            break
    settled, found = history[-1] < options.settled, statistics(sampling, deformed, u)
    return Solution(p, history, bool(settled), time.perf_counter() - start, found)


def freeform(
    reference: np.ndarray, deformed: np.ndarray, options: FreeformOptions
) -> tuple[SplineGrid, Solution, list[dict]]:
    """The grid, its coefficients as the u (nx, ny, nz, 3) of a solution, and a row for each level.

    Images are spline coefficients (nx, ny, nz). The verdict and sigma(r) are the last level's, the
    history is that of all levels."""
    grid = grid_over(reference.shape, options.levels[0].spacing)
    u, table, history, seconds = affine_start(grid, reference, deformed, options.axis), [], [], 0.0
    for level in options.levels:
        while grid.spacing > 1.01 * level.spacing and has_room(grid.finer(), reference.size):
            grid, u = grid.finer(), refine(u)
        blurred = gaussian_blur(reference, level.blur)
        stride = max(level.stride, thinning(reference.size, MOST))
        sampling = sample(grid, blurred, stride, level.clear, options.degree)
        blurred = gaussian_blur(deformed, level.blur)
        solution = register_level(sampling, blurred, u, level, options)
        u, history = solution.u, history + solution.history
        seconds += solution.seconds
        table.append(level_row(level, sampling, solution))
        log.info("free-form: %s", table[-1])
    return grid, replace(solution, history=history, seconds=seconds), table


def has_room(grid: SplineGrid, voxels: int) -> bool:
    """Whether the matrices of a grid fit in what an image of so many voxels asks for anyway."""
    found = np.prod(grid.shape) <= max(ALWAYS, voxels / ROOM)
    if not found:
        log.warning(
            "free-form: a spacing of %.3g voxels would take %d control points (at most %d here): it "
            "stays %.3g; scans.bin and freeform.spacing are small for this image",
            grid.spacing, np.prod(grid.shape), max(ALWAYS, voxels / ROOM), 2 * grid.spacing,
        )  # fmt: skip
    return bool(found)


def level_row(level: Level, sampling: Sampling, solution: Solution) -> dict:
    """What a level did, for logs and tables."""
    return {
        "spacing": sampling.grid.spacing,
        "blur": level.blur,
        "points": len(sampling.grey),
        "iterations": solution.iterations,
        "last_step": solution.history[-1],
        "residual_std": solution.residual["std"],
    }
