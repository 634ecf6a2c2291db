"""Seeds of the cells: a dense packing of spheres with scattered radii."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

RADIUS_CV = 0.15
"""Coefficient of variation of the lognormal radii."""

DENSITY = 0.62
"""Volume share of the spheres."""

MEAN_RADIUS = 0.44
"""Mean radius of the spheres over the cell size."""

STEPS, OVERLAP = 200, 0.05
"""Packing stops after so many steps or at this largest overlap over the mean radius."""


def lognormal_radii(count: int, mean: float, rng: np.random.Generator) -> np.ndarray:
    """(count,) radii of the given mean and coefficient of variation RADIUS_CV."""
    s2 = np.log1p(RADIUS_CV**2)
    return mean * np.exp(np.sqrt(s2) * rng.standard_normal(count) - s2 / 2)


def sphere_count(box: np.ndarray, mean: float) -> int:
    """Number of spheres that fill the box (3,) to DENSITY; E[r^3] of a lognormal is exact."""
    volume = 4 / 3 * np.pi * mean**3 * (1 + RADIUS_CV**2) ** 3
    return round(DENSITY * float(np.prod(box)) / volume)


def push(x: np.ndarray, r: np.ndarray, box: np.ndarray) -> tuple[np.ndarray, float]:
    """One force-biased step: each overlapping pair moves apart by half its overlap.

    x (n, 3), r (n,), box (3,) periodic -> moved x (n, 3), largest overlap over the mean radius.
    """
    pairs = cKDTree(x, boxsize=box).query_pairs(2 * r.max(), output_type="ndarray")
    i, j = pairs.T
    gap = x[j] - x[i]
    gap -= box * np.round(gap / box)
    distance = np.linalg.norm(gap, axis=1)
    overlap = np.maximum(r[i] + r[j] - distance, 0)
    shift = gap * (0.5 * overlap / np.maximum(distance, 1e-9))[:, None]
    moved = np.empty_like(x)
    for k in range(3):
        moved[:, k] = x[:, k] + 0.8 * (
            np.bincount(j, shift[:, k], len(x)) - np.bincount(i, shift[:, k], len(x))
        )
    return moved % box, float(overlap.max() / r.mean())


def pack(box: np.ndarray, mean: float, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Spheres in a periodic box (3,) -> centres (n, 3) in [0, box), radii (n,)."""
    count = sphere_count(box, mean)
    radii = lognormal_radii(count, mean, rng)
    centres = rng.random((count, 3)) * box
    for _ in range(STEPS):
        centres, overlap = push(centres, radii, box)
        if overlap < OVERLAP:
            break
    return centres, radii
