"""Compressible neo-Hookean quadratic tetrahedra: energy, force and tangent of each element.

W(F) = mu/2 (F:F - 3 - 2 ln J) + lam/2 (ln J)^2 [Bonet & Wood 2008, eq. 6.27], total Lagrangian,
four Gauss points. Sides are straight in the reference, so that its Jacobian is one per element.

Each node adds up what its own elements give, always in the same order: parallel and the same to the
last bit. Colours of elements that share no node were tried too: forty barriers a call, which cost
more than the work on a busy machine.
"""

import numba as nb
import numpy as np


@nb.njit(inline="always")
def _gradients(slopes, inverse, b):
    """b (10, 3) = dN/dX at one point, from dN/dxi (10, 3) and dxi/dX (3, 3)."""
    for a in range(10):
        for j in range(3):
            b[a, j] = (
                slopes[a, 0] * inverse[0, j]
                + slopes[a, 1] * inverse[1, j]
                + slopes[a, 2] * inverse[2, j]
            )


@nb.njit(inline="always")
def _deformation(x, nodes, b, f):
    """f (3, 3) = dx/dX, and its determinant."""
    f[:] = 0.0
    for a in range(10):
        for i in range(3):
            for j in range(3):
                f[i, j] += x[nodes[a], i] * b[a, j]
    return (
        f[0, 0] * (f[1, 1] * f[2, 2] - f[1, 2] * f[2, 1])
        - f[0, 1] * (f[1, 0] * f[2, 2] - f[1, 2] * f[2, 0])
        + f[0, 2] * (f[1, 0] * f[2, 1] - f[1, 1] * f[2, 0])
    )


@nb.njit(inline="always")
def _inverse_transpose(f, det, g):
    """g (3, 3) = F^-T."""
    for i in range(3):
        k, m = (i + 1) % 3, (i + 2) % 3
        for j in range(3):
            p, q = (j + 1) % 3, (j + 2) % 3
            g[i, j] = (f[k, p] * f[m, q] - f[k, q] * f[m, p]) / det


@nb.njit(inline="always")
def _pushed(g, b, s):
    """s (10, 3) = F^-T b: gradients of the shape functions in the deformed solid."""
    for a in range(10):
        for i in range(3):
            s[a, i] = g[i, 0] * b[a, 0] + g[i, 1] * b[a, 1] + g[i, 2] * b[a, 2]


@nb.njit(parallel=True, cache=True)
def energies(x, cells, inverse, volume, slopes, lam, mu):
    """Energy (m,) of each element; infinite where it is turned inside out at a Gauss point."""
    m, points = len(cells), len(slopes)
    out = np.empty(m)
    for e in nb.prange(m):
        b, f = np.empty((10, 3)), np.empty((3, 3))
        total = 0.0
        for q in range(points):
            _gradients(slopes[q], inverse[e], b)
            det = _deformation(x, cells[e], b, f)
            if not det > 0:
                total = np.inf
                break
            log = np.log(det)
            total += 0.5 * mu * (np.sum(f * f) - 3 - 2 * log) + 0.5 * lam * log * log
        out[e] = total * volume[e] / points
    return out


@nb.njit(parallel=True, cache=True)
def element_forces(x, cells, inverse, volume, slopes, lam, mu):
    """(m, 10, 3) gradient of the energy of each element: w P b_a, P = mu F + (lam ln J - mu) F^-T."""
    m, points = len(cells), len(slopes)
    out = np.zeros((m, 10, 3))
    for e in nb.prange(m):
        b, f, g = np.empty((10, 3)), np.empty((3, 3)), np.empty((3, 3))
        for q in range(points):
            _gradients(slopes[q], inverse[e], b)
            det = _deformation(x, cells[e], b, f)
            _inverse_transpose(f, det, g)
            w, pressure = volume[e] / points, lam * np.log(det) - mu
            for a in range(10):
                for i in range(3):
                    total = 0.0
                    for j in range(3):
                        total += (mu * f[i, j] + pressure * g[i, j]) * b[a, j]
                    out[e, a, i] += w * total
    return out


@nb.njit(parallel=True, cache=True)
def gathered(parts, first, place):
    """(n, 3) sums over the elements of each node of parts (m, 10, 3); place (10 m,): 10 e + a of
    each corner, by node, those of node n from first[n] to first[n + 1]."""
    n = len(first) - 1
    out = np.zeros((n, 3))
    for node in nb.prange(n):
        for p in range(first[node], first[node + 1]):
            e, a = place[p] // 10, place[p] % 10
            for i in range(3):
                out[node, i] += parts[e, a, i]
    return out


@nb.njit(parallel=True, cache=True)
def pushed_forward(x, cells, inverse, volume, slopes, lam, mu):
    """s (m, 4, 10, 3): gradients of the shape functions in the deformed solid at the Gauss points,
    and shear (m, 4) = w (mu - lam ln J)."""
    m, points = len(cells), len(slopes)
    s, shear = np.empty((m, points, 10, 3)), np.empty((m, points))
    for e in nb.prange(m):
        b, f, g = np.empty((10, 3)), np.empty((3, 3)), np.empty((3, 3))
        for q in range(points):
            _gradients(slopes[q], inverse[e], b)
            det = _deformation(x, cells[e], b, f)
            _inverse_transpose(f, det, g)
            _pushed(g, b, s[e, q])
            shear[e, q] = volume[e] / points * (mu - lam * np.log(det))
    return s, shear


@nb.njit(parallel=True, cache=True)
def tangents(s, shear, inverse, volume, slopes, lam, mu, first, place, slot, nnz):
    """Hessian of the energy, blocks (nnz, 3, 3), row by row: with s_a = F^-T b_a,

    K_ab += w [mu (b_a . b_b) 1 + lam s_a s_b^T + (mu - lam ln J) s_b s_a^T]."""
    blocks = np.zeros((nnz, 3, 3))
    points = len(slopes)
    for node in nb.prange(len(first) - 1):
        b = np.empty((10, 3))
        for p in range(first[node], first[node + 1]):
            e, a = place[p] // 10, place[p] % 10
            w = volume[e] / points
            for q in range(points):
                _gradients(slopes[q], inverse[e], b)
                sa, shape = s[e, q, a], s[e, q]
                for c in range(10):
                    block = blocks[slot[e, a, c]]
                    dot = b[a, 0] * b[c, 0] + b[a, 1] * b[c, 1] + b[a, 2] * b[c, 2]
                    for i in range(3):
                        block[i, i] += w * mu * dot
                        for j in range(3):
                            block[i, j] += (
                                w * lam * sa[i] * shape[c, j] + shear[e, q] * shape[c, i] * sa[j]
                            )
    return blocks
