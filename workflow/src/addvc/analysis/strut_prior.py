"""What is likely of a strut, from all struts: how far noise is to be believed.

Coefficients of a strut's motion are measured with a known covariance C. Over the foam each kind of
coefficient is taken to be normal about zero, with a variance P that all measured ones tell (empirical
Bayes [Efron1973]), and its deviation to go as one over the area A of a strut: struts share loads, and
under a load thin ones stretch and bend more. The marginal likelihood of what was measured, with
deviations as A^-p, is greatest for p = .7 (twist), 1.0 and 1.6 (bending, the constant and the linear
part), .75 (stretch), .4 (shear): means of three twins and states; in none for 0.
A strut then has the mean K c and the covariance P - K P, with K = P (P + C)^-1: what is measured well
stays as it is, and what is noise is not taken for strain.
"""

import numpy as np

KINDS_OF_COEFFICIENTS = ((0,), (1, 3), (2, 4), (5,), (6, 7))
"""Twist, bending constant and linear along the strut, stretch, shear: alike about both axes."""

LEAST, TINY = 1e-9, 1e-30
"""Of a variance, over the largest square and at all, so that a foam at rest can be divided by."""


def prior_variances(values: np.ndarray, covariances: np.ndarray, areas: np.ndarray) -> np.ndarray:
    """(8,) variances over the foam of the coefficients times the area of the strut, voxel^2, from those
    of its struts (s, 8), measured with covariances (s, 8, 8), of areas (s,)."""
    variances = np.empty(values.shape[1])
    for kind in KINDS_OF_COEFFICIENTS:
        square = (values[:, kind] * areas[:, None]).ravel() ** 2
        noise = np.stack([covariances[:, n, n] * areas**2 for n in kind], axis=1).ravel()
        variances[list(kind)] = spread(square, noise)
    return variances


def spread(square: np.ndarray, noise: np.ndarray) -> float:
    """The variance behind squares (s,) of numbers that have noise of variances (s,): by moments, which
    are right in the mean even where the variances of the noise are poorly known."""
    return max(float(np.mean(square - noise)), LEAST * float(np.max(square, initial=0)), TINY)


def posterior(
    values: np.ndarray, covariance: np.ndarray, variances: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Mean (8,) and covariance (8, 8) of the coefficients (8,) of one strut."""
    prior = np.diag(variances)
    gain = np.linalg.solve(prior + covariance, prior).T
    return gain @ values, prior - gain @ prior
