"""What a network fit is judged by: the images, by Stein's unbiased risk.

For a weight w of equilibrium (`correlation.network`), as for l_L (`correlation.cutoff`),

    risk(w) = sum rho(r_w) + 2 E[sum n grad I_r . u_w(n)],

r_w the residual of what the weight leads to, n that of noise alone, and u_w(n) what meso DVC and the fit
make of it, at points in the struts; E is the mean over draws of the noise of both images. What passes
for noise in the void may be its texture, so that draws count for no more than there is in the residual.
"""

from dataclasses import dataclass

import numpy as np

from addvc.correlation.metric import (
    Reference,
    geman_mcclure,
    reference_on,
    residual_at,
    residual_statistics,
    right_hand_side,
    seen_square,
)
from addvc.correlation.register import System
from addvc.correlation.uncertainty import SEED, Noise
from addvc.fem.mesh import Mesh
from addvc.fem.quadrature import gauss_points, thinned
from addvc.images.spline import spline_value

PER_NODE, FEWEST = 25, 10_000
"""Tetrahedra of the micro mesh, by their middles, for each node of the frame, about, and at least in
all. With a fourth of them errors are 2 % larger."""

DRAWS = 2


@dataclass(frozen=True, eq=False)
class RiskData:
    """I_r at points (Q,) of the struts, I_d by its spline coefficients (nx, ny, nz), the scale of the
    residuals (grey levels; None: plain squares), and draws of the noise: residuals (d, Q) with the
    displacements (d, n, 3) that meso DVC makes of them."""

    reference: Reference
    deformed: np.ndarray
    scale: float | None
    noise: np.ndarray
    answers: np.ndarray

    def fit(self, u: np.ndarray) -> tuple[float, np.ndarray]:
        """Mean of rho(r) under u (Q, 3), grey levels^2, and how much each point counts in it (Q,): one
        outside of I_d costs as much as one on a wrong strut, whatever the noise."""
        r, inside = residual_at(self.reference, self.deformed, u)
        trust = np.ones(len(r)) if self.scale is None else geman_mcclure(r, self.scale)
        return self.mean(seen_square(self.reference, r, inside, self.scale)), inside * trust

    def mean(self, values: np.ndarray) -> float:
        """Of values (..., Q), weighted."""
        weight = self.reference.quadrature.weight
        return float(np.mean(values @ weight) / weight.sum())

    def along(self, answers: np.ndarray) -> np.ndarray:
        """What displacements (d, Q, 3) change in the grey level (d, Q)."""
        return np.einsum("qi,dqi->dq", self.reference.gradient, answers)

    def share(self, u: np.ndarray, answers: np.ndarray) -> float:
        """Of the variance of the draws, what is noise: no more than leaves, after answers (d, Q, 3),
        what there is under u (Q, 3). Texture of a void that is not empty moves with the solid."""
        left = self.mean((self.noise - self.along(answers)) ** 2)
        return min(1.0, self.fit(u)[0] / left) if left > 0 else 1.0

    def risk(self, u: np.ndarray, answers: np.ndarray, share: float) -> dict:
        """Risk of displacements u (Q, 3) that noise changes by answers (d, Q, 3), grey levels^2, less
        its constant, and its two parts."""
        fit, trust = self.fit(u)
        freedom = 2 * share * self.mean(trust * self.noise * self.along(answers))
        return {"risk": fit + freedom, "misfit": fit, "freedom": freedom}

    def residual(self, u: np.ndarray) -> dict:
        """Statistics of the residual under u (Q, 3)."""
        r, inside = residual_at(self.reference, self.deformed, u)
        return residual_statistics(r, inside, self.reference.quadrature.weight)


def risk_data(
    micro: Mesh,
    nodes: int,
    images: list[np.ndarray],
    system: System,
    scale: float | None,
    noise: Noise,
) -> RiskData:
    """What a displacement by the `system` of meso DVC is judged by, of [I_r, I_d] by their spline
    coefficients with the noise of each, in the middle of some tetrahedra of the micro mesh, for a frame
    of so many nodes."""
    degree = system.reference.degree
    middles = thinned(gauss_points(micro, 1), max(FEWEST, PER_NODE * nodes))
    reference = reference_on(micro, middles, images[0], degree)
    rng, residuals, answers = np.random.default_rng(SEED), [], []
    for _ in range(DRAWS):
        volume = noise.volume(images[0].shape, rng)  # that of both images: sqrt(2) of it
        r = np.sqrt(2) * spline_value(volume, system.reference.quadrature.points, degree)[0]
        right = right_hand_side(system.reference, np.where(system.reference.inside, r, 0))
        answers.append(system.factor.solve(right).reshape(-1, 3))
        residuals.append(np.sqrt(2) * spline_value(volume, reference.quadrature.points, degree)[0])
    return RiskData(reference, images[1], scale, np.stack(residuals), np.stack(answers))
