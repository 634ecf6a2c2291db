"""How a strut carries its load: shares of bending, stretching and torsion in its energy.

Per length, for a round section of area A: bending E I k^2 / 2, stretching E A e^2 / 2 and torsion
G J w^2 / 2, with I = A^2 / 4 pi, J = 2 I, G = E / 2 (1 + nu). Energies are in units of Young's
modulus times voxel^3. Noise adds its variance to each square; energies are therefore expectations
under what is likely of the strut (`strut_prior`), so that noise alone has none. The scatter of the
nodes about a beam is no noise: it only widens the deviations.
"""

from dataclasses import dataclass

import numpy as np

from addvc.analysis.strut_motion import BENDING, STRETCH, TWIST, StrutMotion
from addvc.analysis.strut_prior import posterior
from addvc.analysis.struts import Strut

KINDS = ("bending", "stretching", "torsion")


@dataclass(frozen=True, eq=False)
class StrutEnergy:
    """Of one strut: energies (3,) of bending, stretching, torsion; their covariance (3, 3); mean
    axial strain with its standard deviation; curvature (rms, weighted with I) and twist, 1/voxel."""

    energies: np.ndarray
    covariance: np.ndarray
    axial_strain: float
    axial_strain_std: float
    curvature: float
    twist: float

    @property
    def shares(self) -> np.ndarray:
        """(3,) of the whole energy; nan where there is none."""
        return shares(self.energies)

    @property
    def bending_share_std(self) -> float:
        """Standard deviation of the share of bending."""
        return self.share_std(0)

    def share_std(self, kind: int) -> float:
        """Standard deviation of the share of one of KINDS; nan where there is no energy."""
        total = self.energies.sum()
        if not total > 0:
            return float("nan")
        slope = np.eye(len(KINDS))[kind] / total - self.energies[kind] / total**2
        return float(np.sqrt(max(slope @ self.covariance @ slope, 0.0)))


def shares(energies: np.ndarray) -> np.ndarray:
    """(3,) of the sum of energies (3,); nan where there is none."""
    total = energies.sum()
    return energies / total if total > 0 else np.full(len(energies), np.nan)


def strut_energy(
    strut: Strut, fit: StrutMotion, nu: float, variances: np.ndarray | None = None
) -> StrutEnergy:
    """What a motion costs a strut of the sections that the mesh has; nu: Poisson's ratio; variances
    (8,): of the coefficients over the foam, None to take them as they were measured."""
    area = (strut.area[1:] + strut.area[:-1]) / 2
    inertia = area**2 / (4 * np.pi)
    forms = quadratic_forms(fit, area, inertia, nu)
    c, mean, doubt = fit.coefficients, fit.coefficients, np.zeros_like(fit.noise)
    if variances is not None:
        mean, doubt = posterior(c, fit.noise, variances)
    energies = np.array([mean @ form @ mean + np.trace(form @ doubt) for form in forms])
    slopes = 2 * np.stack([form @ mean for form in forms])
    return StrutEnergy(
        energies,
        slopes @ (doubt + fit.covariance) @ slopes.T,
        float(c[STRETCH][0]),
        float(np.sqrt((fit.covariance + fit.noise)[STRETCH, STRETCH][0, 0])),
        float(np.sqrt(2 * energies[0] / (inertia @ fit.beam.length))),
        float(c[TWIST][0]),
    )


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
