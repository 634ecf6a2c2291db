"""The geometrically exact (Simo-Reissner) beam element: energy, forces and tangent.

Two nodes with positions x_a and rotations R_a from the reference; one point of integration, so that
shear does not lock [Simo1986]. With d = x_2 - x_1, phi = log(R_1^T R_2), R_m = R_1 exp(phi / 2), the
rotation half-way between the ends, and t the reference tangent, the strains are

    Gamma = R_m^T d / L - t        stretch along t, shear across it
    K     = phi / L                twist along t, bending across it

and W = L/2 [Gamma . C_n Gamma + K . C_m K]. Sections are isotropic across t (a three-lobed section
is), so that each C needs two moduli. Rotations are updated as R_a exp(theta_a); W'' is the second
derivative along straight lines of (x_a, theta_a), which is symmetric anywhere. The derivation only
needs how R_m turns, omega = (a_1 + a_2) / 2 + tau phi x (a_2 - a_1) / 2 with tau = tan(|phi| / 4) /
|phi|, and phi' = J_r^-1(phi) a_2 - J_l^-1(phi) a_1.

Hinging struts: beyond a curvature kappa_y the bending moment saturates (deformation theory),
M(kappa) = B [h kappa + (1 - h) kappa_y tanh(kappa / kappa_y)], and resumes its elastic slope beyond
kappa_f, as a strut does not fold tighter than its own thickness. Without that, hinges of 180 degrees
in one element were met at 11 % of compression.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

ENERGIES = ("stretching", "shear", "torsion", "bending")


class Sections(NamedTuple):
    """Of m elements: reference and moduli; Young's modulus is one, lengths in voxels."""

    length: np.ndarray  # (m,)
    tangent: np.ndarray  # (m, 3) unit, reference
    axial: np.ndarray  # (m,) E A
    shear: np.ndarray  # (m,) k G A
    torsion: np.ndarray  # (m,) G J
    bending: np.ndarray  # (m,) E I
    yield_curvature: np.ndarray  # (m,) kappa_y, inf for elastic struts
    fold_curvature: np.ndarray  # (m,) kappa_f, inf for elastic struts
    hardening: float  # h


@njit(cache=True)
def _cross(a, b, out):
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@njit(cache=True)
def _skew(a, out):
    """[a] with [a] b = a x b."""
    out[0, 0] = out[1, 1] = out[2, 2] = 0.0
    out[0, 1], out[0, 2] = -a[2], a[1]
    out[1, 0], out[1, 2] = a[2], -a[0]
    out[2, 0], out[2, 1] = -a[1], a[0]


@njit(cache=True)
def _product(a, b, out):
    """out = a b for small matrices."""
    for i in range(a.shape[0]):
        for j in range(b.shape[1]):
            total = 0.0
            for k in range(a.shape[1]):
                total += a[i, k] * b[k, j]
            out[i, j] = total


@njit(cache=True)
def rotation_vector(q, out):
    """out = log q for a rotation matrix q (3, 3) by less than pi."""
    out[0] = 0.5 * (q[2, 1] - q[1, 2])
    out[1] = 0.5 * (q[0, 2] - q[2, 0])
    out[2] = 0.5 * (q[1, 0] - q[0, 1])
    sine = np.sqrt(out[0] ** 2 + out[1] ** 2 + out[2] ** 2)
    cosine = 0.5 * (q[0, 0] + q[1, 1] + q[2, 2] - 1.0)
    angle = np.arctan2(sine, cosine)
    scale = 1.0 + angle * angle / 6.0 if sine < 1e-6 else angle / sine
    for i in range(3):
        out[i] *= scale


@njit(cache=True)
def exponential(v, scale, out):
    """out = exp(scale [v]), a rotation matrix (3, 3)."""
    a, b, c = scale * v[0], scale * v[1], scale * v[2]
    q = a * a + b * b + c * c
    if q < 1e-8:
        s, k = 1.0 - q / 6.0, 0.5 - q / 24.0
    else:
        angle = np.sqrt(q)
        s, k = np.sin(angle) / angle, (1.0 - np.cos(angle)) / q
    out[0, 0], out[1, 1], out[2, 2] = (
        1 - k * (b * b + c * c),
        1 - k * (a * a + c * c),
        1 - k * (a * a + b * b),
    )
    out[0, 1], out[1, 0] = k * a * b - s * c, k * a * b + s * c
    out[0, 2], out[2, 0] = k * a * c + s * b, k * a * c - s * b
    out[1, 2], out[2, 1] = k * b * c - s * a, k * b * c + s * a


@njit(cache=True)
def _coefficients(q):
    """tau, tau'/|phi|, c, c'/|phi| at |phi|^2 = q: see the head of this module; J_r^-1 = 1 +
    [phi]/2 + c [phi]^2."""
    if q < 1e-4:
        tau = 0.25 + q / 192.0 + q * q / 7680.0
        tau1 = 1.0 / 96.0 + q / 1920.0
        c = 1.0 / 12.0 + q / 720.0 + q * q / 30240.0
        c1 = 1.0 / 360.0 + q / 7560.0
        return tau, tau1, c, c1
    angle = np.sqrt(q)
    tangent = np.tan(angle / 4.0)
    tau = tangent / angle
    tau1 = ((1.0 + tangent * tangent) * angle / 4.0 - tangent) / (q * angle)
    half = angle / 2.0
    cot = np.cos(half) / np.sin(half)
    f = 1.0 - half * cot
    f1 = -0.5 * cot + 0.5 * half / np.sin(half) ** 2
    return tau, tau1, f / q, (f1 / q - 2.0 * f / (q * angle)) / angle


@njit(cache=True)
def bending_law(kappa, modulus, limit, fold, hardening):
    """Energy per length, moment and slope of the moment at a curvature kappa >= 0."""
    if not np.isfinite(limit):
        return 0.5 * modulus * kappa * kappa, modulus * kappa, modulus
    x = kappa / limit
    share, soft = modulus * hardening, modulus * (1.0 - hardening)
    log_cosh = x + np.log1p(np.exp(-2.0 * x)) - np.log(2.0)
    level, beyond = np.tanh(x), max(kappa - fold, 0.0)
    return (
        0.5 * share * kappa * kappa + soft * limit * limit * log_cosh + 0.5 * modulus * beyond**2,
        share * kappa + soft * limit * level + modulus * beyond,
        share + soft * (1.0 - level * level) + (modulus if beyond > 0.0 else 0.0),
    )


@njit(cache=True)
def _transverse_law(s, e, phi, moment, tangent):
    """Moment (3,) and its derivative by phi (3, 3) from twist and bending; energy parts returned."""
    t, length = s.tangent[e], s.length[e]
    along = phi[0] * t[0] + phi[1] * t[1] + phi[2] * t[2]
    b0, b1, b2 = phi[0] - along * t[0], phi[1] - along * t[1], phi[2] - along * t[2]
    size = np.sqrt(b0 * b0 + b1 * b1 + b2 * b2)
    energy, bend, slope = bending_law(
        size / length, s.bending[e], s.yield_curvature[e], s.fold_curvature[e], s.hardening
    )
    secant = bend / size if size > 1e-10 else s.bending[e] / length
    direction = (b0, b1, b2)
    rise = (slope / length - secant) / (size * size) if size > 1e-10 else 0.0
    torsion = s.torsion[e] / length
    for i in range(3):
        moment[i] = torsion * along * t[i] + secant * direction[i]
        for j in range(3):
            across = (1.0 if i == j else 0.0) - t[i] * t[j]
            tangent[i, j] = (
                torsion * t[i] * t[j] + secant * across + rise * direction[i] * direction[j]
            )
    return 0.5 * torsion * along * along, energy * length


@njit(cache=True)
def _axial_law(s, e, y, force, tangent):
    """Force (3,) = dW/dy and its derivative (3, 3) at y = R_m^T d; energies of stretch and shear."""
    t, length = s.tangent[e], s.length[e]
    axial, shear = s.axial[e], s.shear[e]
    g0, g1, g2 = y[0] / length - t[0], y[1] / length - t[1], y[2] / length - t[2]
    along = g0 * t[0] + g1 * t[1] + g2 * t[2]
    g = (g0, g1, g2)
    for i in range(3):
        force[i] = shear * g[i] + (axial - shear) * along * t[i]
        for j in range(3):
            unit = 1.0 if i == j else 0.0
            tangent[i, j] = (shear * unit + (axial - shear) * t[i] * t[j]) / length
    square = g0 * g0 + g1 * g1 + g2 * g2 - along * along
    return 0.5 * length * axial * along * along, 0.5 * length * shear * square


class Scratch(NamedTuple):
    """Small arrays that the kernels below work in, so that nothing is allocated per element."""

    small: np.ndarray  # (16, 3, 3)
    vector: np.ndarray  # (8, 3)
    wide: np.ndarray  # (6, 3, 9)


@njit(cache=True)
def scratch():
    return Scratch(np.zeros((16, 3, 3)), np.zeros((8, 3)), np.zeros((6, 3, 9)))


@njit(cache=True)
def strains(x1, r1, x2, r2, work):
    """phi and y = R_m^T (x2 - x1) into work.vector[0] and [1], R_m into work.small[0]."""
    phi, y = work.vector[0], work.vector[1]
    middle, q = work.small[0], work.small[1]
    for i in range(3):
        for j in range(3):
            q[i, j] = r1[0, i] * r2[0, j] + r1[1, i] * r2[1, j] + r1[2, i] * r2[2, j]
    rotation_vector(q, phi)
    exponential(phi, 0.5, q)
    _product(r1, q, middle)
    for i in range(3):
        y[i] = 0.0
        for j in range(3):
            y[i] += middle[j, i] * (x2[j] - x1[j])


@njit(cache=True)
def element_energy(s, e, x1, r1, x2, r2, work, parts):
    """Energies (4,) of element e in the order of ENERGIES, into parts."""
    strains(x1, r1, x2, r2, work)
    parts[0], parts[1] = _axial_law(s, e, work.vector[1], work.vector[2], work.small[2])
    parts[2], parts[3] = _transverse_law(s, e, work.vector[0], work.vector[3], work.small[3])


@njit(cache=True)
def element_tangent(s, e, x1, r1, x2, r2, work, gradient, hessian):
    """Gradient (2, 6) and Hessian (2, 6, 2, 6) of W_e by (x_a, theta_a); returns W_e."""
    strains(x1, r1, x2, r2, work)
    phi, y, force, moment = work.vector[0], work.vector[1], work.vector[2], work.vector[3]
    c_n, c_m = work.small[2], work.small[3]
    stretch, shear = _axial_law(s, e, y, force, c_n)
    twist, bend = _transverse_law(s, e, phi, moment, c_m)
    _kinematics(phi, y, work)
    _gradient(work, gradient)
    _quadratic_form(work)
    _to_nodes(work, hessian)
    return stretch + shear + twist + bend


@njit(cache=True)
def _kinematics(phi, y, work):
    """With v = (epsilon, Sigma, Delta) = (R_m^T (e_2 - e_1), a_1 + a_2, a_2 - a_1): omega = W v,
    phi' = P v and y' = Y v, into work.wide[0], [1], [2]."""
    skew, square, skew_y = work.small[4], work.small[5], work.small[6]
    _skew(phi, skew)
    _product(skew, skew, square)
    _skew(y, skew_y)
    tau, _, c, _ = _coefficients(phi[0] ** 2 + phi[1] ** 2 + phi[2] ** 2)
    turn, bend, move = work.wide[0], work.wide[1], work.wide[2]
    for i in range(3):
        for j in range(3):
            unit = 1.0 if i == j else 0.0
            turn[i, j], bend[i, j] = 0.0, 0.0
            turn[i, 3 + j], turn[i, 6 + j] = 0.5 * unit, 0.5 * tau * skew[i, j]
            bend[i, 3 + j], bend[i, 6 + j] = 0.5 * skew[i, j], unit + c * square[i, j]
    _product(skew_y, turn, move)
    for i in range(3):
        move[i, i] += 1.0


@njit(cache=True)
def _gradient(work, gradient):
    """n . y' + m . phi' by node, into gradient (2, 6)."""
    force, moment, middle = work.vector[2], work.vector[3], work.small[0]
    bend, move = work.wide[1], work.wide[2]
    for i in range(3):
        pull = middle[i, 0] * force[0] + middle[i, 1] * force[1] + middle[i, 2] * force[2]
        gradient[0, i], gradient[1, i] = -pull, pull
        both, apart = 0.0, 0.0
        for k in range(3):
            both += force[k] * move[k, 3 + i] + moment[k] * bend[k, 3 + i]
            apart += force[k] * move[k, 6 + i] + moment[k] * bend[k, 6 + i]
        gradient[0, 3 + i], gradient[1, 3 + i] = both - apart, both + apart


@njit(cache=True)
def _quadratic_form(work):
    """W'' as a symmetric matrix (9, 9) on v, into work.wide[3:6] seen as one (9, 9) array.

    W'' = Y^T C_n Y + P^T C_m P + n . y'' + m . phi'', where, with k = n x y and primes along v,
    n . y'' = 2 n . (eps x omega) + (n . omega)(y . omega) - (n . y) omega^2 + k . omega'."""
    phi, y, force, moment = work.vector[0], work.vector[1], work.vector[2], work.vector[3]
    k, k_phi, m_phi, m_square = work.vector[4], work.vector[5], work.vector[6], work.vector[7]
    skew, square = work.small[4], work.small[5]
    turn, bend, move = work.wide[0], work.wide[1], work.wide[2]
    g = work.wide[3:6].reshape(9, 9)
    tau, tau1, c, c1 = _coefficients(phi[0] ** 2 + phi[1] ** 2 + phi[2] ** 2)
    _cross(force, y, k)
    _cross(k, phi, k_phi)
    _cross(moment, phi, m_phi)
    for i in range(3):
        m_square[i] = square[i, 0] * moment[0] + square[i, 1] * moment[1] + square[i, 2] * moment[2]
    skew_n, skew_m, product, extra = work.small[6], work.small[7], work.small[8], work.small[9]
    _skew(force, skew_n)
    _skew(moment, skew_m)
    _product(skew_m, skew, product)
    _skew(m_phi, extra)
    skew_k = work.small[10]
    _skew(k, skew_k)
    n_y = force[0] * y[0] + force[1] * y[1] + force[2] * y[2]
    c_n, c_m, spin = work.small[2], work.small[3], work.small[11]
    for i in range(3):
        for j in range(3):
            spin[i, j] = 0.5 * (force[i] * y[j] + y[i] * force[j]) - (n_y if i == j else 0.0)
    for p in range(9):
        for q in range(9):
            total = 0.0
            for i in range(3):
                for j in range(3):
                    total += (
                        move[i, p] * c_n[i, j] * move[j, q]
                        + bend[i, p] * c_m[i, j] * bend[j, q]
                        + turn[i, p] * spin[i, j] * turn[j, q]
                    )
            g[p, q] = total
    for i in range(3):  # terms of the form eps . B omega and phi' . B (Sigma, Delta)
        for p in range(9):
            first = 0.0
            for j in range(3):
                first -= skew_n[i, j] * turn[j, p]
            g[i, p] += first
            g[p, i] += first
    for p in range(9):
        for j in range(3):
            on_both, on_apart = 0.0, 0.0
            for i in range(3):
                on_both -= 0.5 * bend[i, p] * skew_m[i, j]
                on_apart -= bend[i, p] * (
                    0.5 * tau * skew_k[i, j] + c * (product[i, j] + extra[i, j])
                )
            g[p, 3 + j] += 0.5 * on_both
            g[3 + j, p] += 0.5 * on_both
            g[p, 6 + j] += 0.5 * on_apart
            g[6 + j, p] += 0.5 * on_apart
    for i in range(3):
        for j in range(3):
            term = phi[i] * (0.5 * tau1 * k_phi[j] + c1 * m_square[j])
            g[6 + i, 6 + j] += 0.5 * term
            g[6 + j, 6 + i] += 0.5 * term


@njit(cache=True)
def _to_nodes(work, hessian):
    """The quadratic form on v as one on (x_a, theta_a), into hessian (2, 6, 2, 6)."""
    middle = work.small[0]
    g = work.wide[3:6].reshape(9, 9)
    left, both = work.small[12], work.small[13]
    for block in range(3):  # the rows of epsilon are turned by R_m
        for i in range(3):
            for j in range(3):
                left[i, j] = 0.0
                for k in range(3):
                    left[i, j] += middle[i, k] * g[k, 3 * block + j]
        if block == 0:
            for i in range(3):
                for j in range(3):
                    both[i, j] = 0.0
                    for k in range(3):
                        both[i, j] += left[i, k] * middle[j, k]
            for a in range(2):
                for b in range(2):
                    sign = 1.0 if a == b else -1.0
                    for i in range(3):
                        for j in range(3):
                            hessian[a, i, b, j] = sign * both[i, j]
            continue
        for a in range(2):
            for b in range(2):
                sign = (-1.0 if a == 0 else 1.0) * (-1.0 if b == 0 and block == 2 else 1.0)
                for i in range(3):
                    for j in range(3):
                        if block == 1:
                            hessian[a, i, b, 3 + j] = sign * left[i, j]
                        else:
                            hessian[a, i, b, 3 + j] += sign * left[i, j]
    for a in range(2):
        for b in range(2):
            s, t = (-1.0 if a == 0 else 1.0), (-1.0 if b == 0 else 1.0)
            for i in range(3):
                for j in range(3):
                    hessian[a, 3 + i, b, 3 + j] = (
                        g[3 + i, 3 + j] + t * g[3 + i, 6 + j] + s * g[6 + i, 3 + j]
                    ) + s * t * g[6 + i, 6 + j]
                    hessian[b, 3 + j, a, i] = hessian[a, i, b, 3 + j]


@njit(cache=True)
def turned(rotations, theta):
    """R exp(theta) for rotations (n, 3, 3) and rotation vectors (n, 3)."""
    out, turn = np.empty_like(rotations), np.empty((3, 3))
    for a in range(len(rotations)):
        exponential(theta[a], 1.0, turn)
        _product(rotations[a], turn, out[a])
    return out
