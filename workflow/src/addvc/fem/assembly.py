"""Matrices on a fixed pattern: one 3 x 3 block per pair of nodes that share a cell."""

from dataclasses import dataclass

import numba as nb
import numpy as np
from scipy import sparse

from addvc.fem.mesh import Mesh


@dataclass(frozen=True, eq=False)
class Pattern:
    """Node graph of a mesh in CSR form, and where each pair (e, a, b) falls in it."""

    indptr: np.ndarray
    indices: np.ndarray
    slot: np.ndarray  # (m, a, a) int64


def node_pattern(mesh: Mesh) -> Pattern:
    """The pattern of a matrix between the nodes of `mesh` (diagonal included, sorted columns)."""
    n, per_cell = len(mesh.points), mesh.cells.shape[1]
    rows = np.repeat(mesh.cells, per_cell, axis=1).ravel()
    columns = np.tile(mesh.cells, (1, per_cell)).ravel()
    graph = sparse.coo_matrix((np.ones(len(rows), dtype=np.int8), (rows, columns)), shape=(n, n))
    graph = graph.tocsr()
    graph.sort_indices()
    slot = find_slots(graph.indptr, graph.indices, mesh.cells)
    return Pattern(graph.indptr, graph.indices, slot)


@nb.njit(parallel=True, cache=True)
def find_slots(indptr, indices, cells):
    m, per_cell = cells.shape
    slot = np.empty((m, per_cell, per_cell), np.int64)
    for e in nb.prange(m):
        for a in range(per_cell):
            start, stop = indptr[cells[e, a]], indptr[cells[e, a] + 1]
            for b in range(per_cell):
                slot[e, a, b] = start + np.searchsorted(indices[start:stop], cells[e, b])
    return slot


def block_matrix(pattern: Pattern, blocks: np.ndarray) -> sparse.bsr_matrix:
    """Blocks (nnz, 3, 3) on the pattern as a sparse matrix (3 n, 3 n)."""
    n = len(pattern.indptr) - 1
    return sparse.bsr_matrix((blocks, pattern.indices, pattern.indptr), shape=(3 * n, 3 * n))


def scalar_matrix(pattern: Pattern, values: np.ndarray) -> sparse.csr_matrix:
    """Values (nnz,) on the pattern as a sparse matrix (n, n)."""
    n = len(pattern.indptr) - 1
    return sparse.csr_matrix((values, pattern.indices, pattern.indptr), shape=(n, n))


@nb.njit(cache=True)
def scatter_stiffness(slot, gradients, weights, lam, mu, nnz):
    """K_ab += w [lam b_a b_b^T + mu b_b b_a^T + mu (b_a . b_b) 1], blocks (nnz, 3, 3)."""
    blocks = np.zeros((nnz, 3, 3))
    m, points, per_cell, _ = gradients.shape
    for e in range(m):
        for q in range(points):
            w = weights[e, q]
            for a in range(per_cell):
                ga = gradients[e, q, a]
                for b in range(per_cell):
                    gb = gradients[e, q, b]
                    block = blocks[slot[e, a, b]]
                    dot = ga[0] * gb[0] + ga[1] * gb[1] + ga[2] * gb[2]
                    for i in range(3):
                        block[i, i] += w * mu * dot
                        for j in range(3):
                            block[i, j] += w * (lam * ga[i] * gb[j] + mu * gb[i] * ga[j])
    return blocks


@nb.njit(cache=True)
def scatter_laplacian(slot, gradients, weights, nnz):
    """L_ab += w (b_a . b_b), values (nnz,)."""
    values = np.zeros(nnz)
    m, points, per_cell, _ = gradients.shape
    for e in range(m):
        for q in range(points):
            for a in range(per_cell):
                ga = gradients[e, q, a]
                for b in range(per_cell):
                    gb = gradients[e, q, b]
                    dot = ga[0] * gb[0] + ga[1] * gb[1] + ga[2] * gb[2]
                    values[slot[e, a, b]] += weights[e, q] * dot
    return values


@nb.njit(cache=True)
def scatter_dyads(slot, cell, shape, weight, vectors, nnz):
    """H_ab += w N_a N_b g g^T over the points of a quadrature, blocks (nnz, 3, 3)."""
    blocks = np.zeros((nnz, 3, 3))
    for q in range(cell.shape[0]):
        g = vectors[q]
        for a in range(shape.shape[1]):
            for b in range(shape.shape[1]):
                block = blocks[slot[cell[q], a, b]]
                w = weight[q] * shape[q, a] * shape[q, b]
                for i in range(3):
                    for j in range(3):
                        block[i, j] += w * g[i] * g[j]
    return blocks


@nb.njit(cache=True)
def scatter_vectors(cells, cell, shape, weight, vectors, n):
    """b_a += w N_a g over the points of a quadrature, (n, 3)."""
    out = np.zeros((n, 3))
    for q in range(cell.shape[0]):
        for a in range(shape.shape[1]):
            node = cells[cell[q], a]
            for i in range(3):
                out[node, i] += weight[q] * shape[q, a] * vectors[q, i]
    return out
