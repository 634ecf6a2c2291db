"""Where micro DVC starts: the candidate with the least residual and elastic energy.

Close to what the default method minimises, but without the shell, and the same for every method. The
score of a displacement on the micro mesh is, over the volume V of the mesh,

    (sum w rho(r) + c (v^T K v)(u)) / V,

rho being the robust residual of the default method (Geman-McClure: a point that meets a wrong strut
costs at most the square of its scale), and the second term the elastic energy (E = 1) with the
weight c of a cut-off length l_E. The strain is Green-Lagrange's, so that struts may turn for nothing.
A field that fits a little better by tearing struts thus loses to one that fits and hangs together;
a smooth field that misses struts loses to one that finds them.
"""

from dataclasses import dataclass

import numpy as np

from addvc.correlation.metric import Reference, residual, residual_statistics, seen_square
from addvc.correlation.micro import MicroOptions
from addvc.correlation.regularisation import shear_wave, tikhonov_weight
from addvc.errors import CorrelationError
from addvc.fem.mesh import Mesh, physical_gradients
from addvc.fem.operators import lame, strain
from addvc.fem.quadrature import interpolate


@dataclass(frozen=True, eq=False)
class Judge:
    """I_r at the points of the micro mesh, scale of the residuals (grey levels; None: plain squares),
    weight c of the energy, Poisson's ratio."""

    reference: Reference
    scale: float | None
    weight: float
    nu: float


def elastic_energy(mesh: Mesh, tensor: np.ndarray, nu: float) -> float:
    """Integral of strain : C : strain, E = 1, of strains (m, 3, 3): u^T K u where they are small."""
    lam, mu = lame(nu)
    trace = np.einsum("eii->e", tensor)
    density = lam * trace**2 + 2 * mu * np.einsum("eij,eij->e", tensor, tensor)
    return float(physical_gradients(mesh)[1][:, 0] @ density)


def judge(reference: Reference, options: MicroOptions, scale: float | None) -> Judge:
    """The judge of all candidates, c = (l_E / T)**2 S(v) / (v^T K v) as in `elastic_weight`."""
    mesh, q = reference.mesh, reference.quadrature
    v = shear_wave(mesh.points, options.axis, options.period).reshape(-1, 3)
    along = np.sum(reference.gradient * interpolate(mesh.cells, q.cell, q.shape, v), axis=1)
    trial = float(q.weight @ along**2) / elastic_energy(mesh, strain(mesh, v), options.nu)
    weight = tikhonov_weight(options.l_e, options.period, order=2) * trial
    return Judge(reference, scale, weight, options.nu)


def judged(judge: Judge, deformed: np.ndarray, u: np.ndarray) -> dict:
    """Residuals, energy and score of u (n, 3); `deformed` by its spline coefficients (nx, ny, nz).

    A point outside of the image costs as much as one on a wrong strut."""
    reference, mesh = judge.reference, judge.reference.mesh
    w = reference.quadrature.weight
    r, inside = residual(reference, deformed, u)
    fit = float(w @ seen_square(reference, r, inside, judge.scale)) / w.sum()
    volume = physical_gradients(mesh)[1].sum()
    energy = elastic_energy(mesh, strain(mesh, u, finite=True), judge.nu)
    statistics = residual_statistics(r, inside, w)
    return {
        "residual_std": statistics["std"],
        "outside": statistics["outside"],
        "robust_std": float(np.sqrt(fit)),
        "elastic_strain": float(np.sqrt(energy / volume)),
        "score": float(fit + judge.weight * energy / w.sum()),
    }


def best_candidate(
    judge: Judge, deformed: np.ndarray, candidates: dict[str, np.ndarray]
) -> tuple[str, list[dict]]:
    """The candidate {name: u (n, 3)} with the least score, and a row of figures for each.

    Raises CorrelationError where no score is finite."""
    table = [{"candidate": name} | judged(judge, deformed, u) for name, u in candidates.items()]
    known = [row for row in table if np.isfinite(row["score"])]
    if not known:
        raise CorrelationError(
            f"none of the {len(table)} starts of micro DVC ({', '.join(candidates)}) has a finite "
            "score: the coarser results diverged; see their logs, or add meso.candidates"
        )
    return min(known, key=lambda row: row["score"])["candidate"], table
