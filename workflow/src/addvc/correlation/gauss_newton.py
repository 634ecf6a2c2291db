"""Eq. 3: the modified Gauss-Newton loop. It knows no images; convergence is data."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True, eq=False)
class Solution:
    """u (n, 3) in voxels, rms(du) of each iteration, and whether the criterion was met."""

    u: np.ndarray
    history: list[float]
    converged: bool
    seconds: float = 0.0
    residual: dict = field(default_factory=dict)

    @property
    def iterations(self) -> int:
        return len(self.history)


def rms(field_: np.ndarray) -> float:
    """Root of the mean squared length of vectors (n, 3)."""
    return float(np.sqrt(np.mean(np.sum(np.square(field_), axis=-1))))


def gauss_newton(
    right_hand_side: Callable[[np.ndarray], np.ndarray],
    solve: Callable[[np.ndarray], np.ndarray],
    u: np.ndarray,
    tolerance: float = 1e-3,
    max_iterations: int = 50,
    progress: Callable[[int, float], None] = lambda iteration, step: None,
) -> Solution:
    """u <- u + A^-1 b(u) until rms(du) < tolerance (voxels); u (n, 3), b flattened (3 n,).

    A step that is not finite is not taken, and ends the loop without convergence."""
    start, history = time.perf_counter(), []
    for iteration in range(1, max_iterations + 1):
        du = solve(right_hand_side(u)).reshape(u.shape)
        history.append(rms(du))
        progress(iteration, history[-1])
        if not np.isfinite(history[-1]):
            break
        u = u + du
        if history[-1] < tolerance:
            return Solution(u, history, True, time.perf_counter() - start)
    return Solution(u, history, False, time.perf_counter() - start)
