"""How a strut carries its load: shares of bending, stretching and torsion in its energy.

Per length, for a round section of area A: bending E I k^2 / 2, stretching E A e^2 / 2 and torsion
G J w^2 / 2, with I = A^2 / 4 pi, J = 2 I, G = E / 2 (1 + nu). Energies are in units of Young's
modulus times voxel^3. Noise adds its variance to each square; energies are therefore expectations
under what is likely of the strut (`strut_prior`), so that noise alone has none. The scatter of the
nodes about a beam is no noise: it only widens the deviations. A share is expected likewise, as the
mean over motions drawn from what is likely, which is nearer the true one than the ratio of expected
energies is: where little is known, a few struts with most of the energy decide that ratio.
"""

from dataclasses import dataclass

import numpy as np

from addvc.analysis.strut_motion import BENDING, STRETCH, TWIST, StrutMotion
from addvc.analysis.strut_prior import posterior
from addvc.analysis.struts import Strut

KINDS = ("bending", "stretching", "torsion")

DRAWS = 256
"""Pairs of opposite motions that an expected share is the mean of: it is off by .02 at most, rms."""


@dataclass(frozen=True, eq=False)
class StrutEnergy:
    """Of one strut: expected energies (3,) of bending, stretching, torsion; expected shares (3,) of the
    whole energy with their standard deviations (3,), nan where there is none; mean axial strain with
    its standard deviation; curvature (rms, weighted with I) and twist, 1/voxel."""

    energies: np.ndarray
    shares: np.ndarray
    share_stds: np.ndarray
    axial_strain: float
    axial_strain_std: float
    curvature: float
    twist: float


def strut_energy(
    strut: Strut, fit: StrutMotion, nu: float, variances: np.ndarray | None = None
) -> StrutEnergy:
    """What a motion costs a strut of the sections that the mesh has; nu: Poisson's ratio; variances
    (8,): over the foam, of the coefficients times the area, None to take them as they were measured."""
    area = (strut.area[1:] + strut.area[:-1]) / 2
    inertia = area**2 / (4 * np.pi)
    forms = quadratic_forms(fit, area, inertia, nu)
    c, mean, doubt = fit.coefficients, fit.coefficients, np.zeros_like(fit.noise)
    if variances is not None:
        mean, doubt = posterior(c, fit.noise, variances / strut.area.mean() ** 2)
    energies = np.array([mean @ form @ mean + np.trace(form @ doubt) for form in forms])
    return StrutEnergy(
        energies,
        drawn_shares(forms, mean, doubt).mean(axis=0),
        drawn_shares(forms, mean, doubt + fit.covariance).std(axis=0),
        float(c[STRETCH][0]),
        float(np.sqrt((fit.covariance + fit.noise)[STRETCH, STRETCH][0, 0])),
        float(np.sqrt(2 * energies[0] / (inertia @ fit.beam.length))),
        float(c[TWIST][0]),
    )


def drawn_shares(forms: list[np.ndarray], mean: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Shares (d, 3) of the energies with forms (8, 8), in normal draws of coefficients of that mean (8,)
    and covariance (8, 8), the same draws for every strut; nan where there is no energy."""
    variances, axes = np.linalg.eigh(covariance)
    draws = np.random.default_rng(2417).standard_normal((DRAWS, len(mean)))
    off = draws * np.sqrt(np.maximum(variances, 0)) @ axes.T
    c = mean + np.concatenate([off, -off])
    energies = np.stack([np.einsum("dp,pq,dq->d", c, form, c) for form in forms], axis=1)
    total = energies.sum(axis=1, keepdims=True)
    return np.divide(energies, total, out=np.full(energies.shape, np.nan), where=total > 0)


def quadratic_forms(
    fit: StrutMotion, area: np.ndarray, inertia: np.ndarray, nu: float
) -> list[np.ndarray]:
    """Q (8, 8) of each energy c . Q c, for sections (g - 1,): bending, stretching, torsion."""
    shapes, length = fit.beam.shapes, fit.beam.length
    stiffness = {
        "bending": (BENDING, inertia),
        "stretching": (STRETCH, area),
        "torsion": (TWIST, inertia / (1 + nu)),
    }
    forms = []
    for kind in KINDS:
        where, modulus = stiffness[kind]
        form = np.zeros((len(shapes),) * 2)
        form[where, where] = 0.5 * np.einsum(
            "pgi,qgi,g->pq", shapes[where], shapes[where], modulus * length
        )
        forms.append(form)
    return forms
