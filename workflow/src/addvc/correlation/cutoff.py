"""The cut-off length l_E of micro DVC, l_L of meso DVC, chosen from the images: the least unbiased risk.

A longer l_E keeps more of the noise out and lets less of the motion in. For u = A^-1 b, linear in the
images, what it costs altogether is known without knowing the motion [Stein, Ann. Statist. 9, 1981]:

    risk(l_E) = S(u) + 2 E[n^T A^-1 n] - const,

S(u) the functional of the residuals, n the right-hand side that the noise of both images makes, and
the constant what that noise leaves in the residuals of the right motion. Its expectation is
|u - u_true|^2 in the metric H: the error as the images see it. The expectation over n is
a mean over draws, as in `correlation.uncertainty`; the same draws serve every l_E. What passes for
noise in the void may be its texture, which moves with the solid (trabecular bone: 10 grey levels,
where the residual had 1.1 in all). So draws are scaled down until they leave no more than there is
in the residual of u.

The search climbs a ladder of l_E, then goes down it, as long as the risk falls: for each rung one
linear step from a u that a stage has found, with conjugate gradients preconditioned by its factor.

On the default twin, rms error in voxels with l_E = 0.8 cell size in all states and with the one
chosen: .090 / .063, .093 / .073, .109 / .104 at 3.4, 5.2, 12.3 % (l_E of 78, 78 and 35 voxels); where
every strut moves on its own (benchmarks, `strut`) .544 / .421 (3 voxels).
"""

import logging
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, cg

from addvc.correlation.metric import hessian, residual, right_hand_side, robust_square
from addvc.correlation.register import System, forces, pull
from addvc.correlation.uncertainty import Noise, of_two_images
from addvc.errors import CorrelationError
from addvc.fem.assembly import node_pattern

log = logging.getLogger(__name__)

RATIO = 1.5
"""Of neighbouring l_E: the risk is flat about its least. At 3.4 % on the default twin the error is .070
voxel one rung below what is chosen, .063 there and .061 one above."""

PRECISE = 1e-2
"""Relative tolerance of the steps: risks differ by tenths."""


@dataclass(frozen=True)
class Ladder:
    """Powers of RATIO, on the l_E of the configuration, to choose from; the noise of an image; draws.

    Beyond the longest the motion of nodes gains little, while the energy, which knows of no load on the
    ends of the mesh, undoes part of the compression: on the default twin at 3.4 % with 2 / 3 / 4 rungs
    .070 / .063 / .061 voxel rms, and the strain of cells is .0003 / .0004 / .0008 too small."""

    noise: Noise
    shortest: int = -5
    longest: int = 3
    draws: int = 1


@dataclass(frozen=True, eq=False)
class Trial:
    """A u (n, 3) of a system, what the images pull it to, and draws of noise (d, 3 n).

    `pull` b (3 n,) and `forces` M u + f (3 n,) at u: they balance where u has converged. `share`: of the
    variance of the draws, what is noise."""

    system: System
    deformed: np.ndarray
    u: np.ndarray
    hessian: sparse.spmatrix
    pull: np.ndarray
    forces: np.ndarray
    noise: list[np.ndarray]
    share: float


def trial_of(system: System, deformed: np.ndarray, u: np.ndarray, ladder: Ladder) -> Trial:
    """What every rung needs of `system`, whose u (n, 3) it is; `deformed`: spline coefficients."""
    reference = system.reference
    r, _ = residual(reference, deformed, u)
    draw = of_two_images(system, deformed.shape, ladder.noise)
    draws = [np.where(reference.inside, draw(), 0).astype(float) for _ in range(ladder.draws)]
    noise = [right_hand_side(reference, one) for one in draws]
    h = hessian(reference, node_pattern(reference.mesh))
    whole = np.mean([reference.quadrature.weight @ one**2 for one in draws])
    left = whole - np.mean([taken(system, h, n) for n in noise])
    share = min(1.0, misfit(system, deformed, u) / left) if left > 0 else 1.0
    return Trial(system, deformed, u, h, pull(system, r), forces(system, u), noise, share)


def taken(system: System, h: sparse.spmatrix, n: np.ndarray) -> float:
    """How much of the square of the residuals of noise goes into its displacement A^-1 n (3 n,)."""
    x = system.factor.solve(n)
    return float(2 * n @ x - x @ (h @ x))


def misfit(system: System, deformed: np.ndarray, u: np.ndarray) -> float:
    """S(u) of u (n, 3), grey levels^2 voxel: the robust one where the system is robust."""
    r, _ = residual(system.reference, deformed, u)
    return float(system.reference.quadrature.weight @ robust_square(r, system.scale))


def risk(trial: Trial, times: float) -> dict:
    """The risk of l_E `times` that of the system, less its constant, and its two parts."""
    solve = solver_with(trial, times**2)
    step = solve(trial.pull - times**2 * trial.forces)
    fit = misfit(trial.system, trial.deformed, trial.u + step.reshape(-1, 3))
    freedom = 2 * trial.share * float(np.mean([n @ solve(n) for n in trial.noise]))
    found = {"risk": fit + freedom, "misfit": fit, "freedom": freedom, "noise": trial.share**0.5}
    return {"times": times} | found


def solver_with(trial: Trial, factor: float) -> Callable[[np.ndarray], np.ndarray]:
    """Solves (H + factor M) x = b: conjugate gradients, preconditioned by what the system has.

    It raises CorrelationError where they do not converge."""
    matrix = (trial.hessian + factor * trial.system.regularisation).tocsr()
    known = LinearOperator(matrix.shape, matvec=trial.system.factor.precondition)

    def solve(b: np.ndarray) -> np.ndarray:
        x, info = cg(matrix, b, M=known, rtol=PRECISE)
        if info:
            raise CorrelationError(
                f"the cut-off cannot be chosen: {info} iterations did not solve for {factor:.2g} times "
                "the regularisation; set micro.l_e or meso.l_l to a length (voxels)"
            )
        return x

    return solve


def least_risk(trial: Trial, ladder: Ladder, rung: int) -> tuple[int, list[dict]]:
    """The rung to go to from `rung`, downhill by one as long as the risk falls, and the trials."""
    found = {rung: risk(trial, 1.0)}
    for step in (1, -1):
        here = rung
        while ladder.shortest <= here + step <= ladder.longest:
            found[here + step] = risk(trial, RATIO ** (here + step - rung))
            if found[here + step]["risk"] >= found[here]["risk"]:
                break
            here += step
        if here != rung:
            break
    best = min(found, key=lambda k: found[k]["risk"])
    return best, [row | {"rung": k} for k, row in sorted(found.items())]
