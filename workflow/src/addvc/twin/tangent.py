"""Energy, forces and tangent of the whole network, and the factor of the tangent.

The pattern of the tangent is fixed: 6 x 6 blocks between the ends of each beam and between the
beams that are about to touch, columns in an order of elimination by nested dissection.
Kernels write straight into the data of the sparse matrix. Nothing is summed in parallel, so that the
same network always gives the same bytes.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy import sparse

from addvc.fem.assembly import find_slots
from addvc.fem.solver import dissection

from . import contact
from .beam import element_energy, element_tangent, scratch
from .motion import Motion
from .structure import Structure


@dataclass(eq=False)
class Tangent:
    """The matrix (6 n, 6 n) and its symbolic factor, for some `pairs` (p, 2) of near beams.

    `order` (n,): nodes in the order of elimination; `rank` (n,) its inverse; `indptr` (n + 1,)
    counts the node blocks of each column; slots are positions of node blocks in that pattern;
    `seen_at` (n, 3): where the nodes were when pairs were last looked for."""

    pairs: np.ndarray
    order: np.ndarray
    rank: np.ndarray
    indptr: np.ndarray
    element_slot: np.ndarray
    pair_slot: np.ndarray
    diagonal: np.ndarray
    matrix: sparse.csc_matrix
    factor: object
    seen_at: np.ndarray

    @property
    def where(self) -> tuple[np.ndarray, np.ndarray]:
        """What the kernels need to find a block."""
        return self.rank, self.indptr


def tangent_pattern(structure: Structure, pairs: np.ndarray, positions: np.ndarray) -> Tangent:
    """An empty tangent with room for the pairs of beams (p, 2), found at positions (n, 3)."""
    from sksparse.cholmod import analyze  # loaded where it is needed: a truth is read without

    n = len(structure.reference)
    groups = structure.elements, structure.elements[pairs].reshape(-1, 4)
    rows = np.concatenate([np.repeat(g, g.shape[1], axis=1).ravel() for g in groups])
    columns = np.concatenate([np.tile(g, (1, g.shape[1])).ravel() for g in groups])
    graph = sparse.csr_matrix((np.ones(len(rows)), (rows, columns)), shape=(n, n))
    order = dissection(graph, block=1)
    rank = np.empty(n, dtype=np.int32)
    rank[order] = np.arange(n)
    graph = graph[order][:, order].tocsr()
    graph.sort_indices()
    indptr, indices = graph.indptr.astype(np.int64), graph.indices
    slots = [find_slots(indptr, indices, rank[g]) for g in groups]
    diagonal = find_slots(indptr, indices, np.arange(n, dtype=np.int32)[:, None])[:, 0, 0]
    matrix = expanded(indptr, indices)
    factor = analyze(matrix, mode="supernodal", ordering_method="natural")
    return Tangent(pairs, order, rank, indptr, *slots, diagonal, matrix, factor, positions)


def expanded(indptr: np.ndarray, indices: np.ndarray) -> sparse.csc_matrix:
    """Zeros on the pattern of 6 x 6 blocks given by the node columns (indptr, indices)."""
    count = np.diff(indptr)
    rows = (6 * indices[:, None] + np.arange(6)).astype(np.int32)
    columns = [np.tile(rows[a:b].ravel(), 6) for a, b in itertools.pairwise(indptr)]
    pointer = np.concatenate([[0], np.cumsum(np.repeat(6 * count, 6))]).astype(np.int32)
    data, n = np.zeros(pointer[-1]), 6 * len(count)
    return sparse.csc_matrix((data, np.concatenate(columns), pointer), shape=(n, n))


def energies(structure: Structure, motion: Motion, pairs: np.ndarray) -> tuple[np.ndarray, float]:
    """Elastic energies (4,) in the order of `beam.ENERGIES`, and that of the penalties."""
    parts = np.zeros(4)
    beams = structure.sections, structure.elements
    sum_energies(*beams, motion.positions, motion.rotations, parts)
    touching = contact.pair_energy(structure.guards, pairs, motion.positions)
    return parts, touching + contact.platen_energy(
        structure.platens, np.array(motion.platens), motion.positions
    )


def linearise(
    structure: Structure, motion: Motion, tangent: Tangent, move: np.ndarray | None = None
) -> np.ndarray:
    """Gradient (n, 6) of the energy by positions and turns; W'' goes to tangent.matrix.

    Rows and columns of clamped nodes are those of the unit matrix; the gradient at them is minus
    the reaction. With a `move` (n, 6) of the clamped nodes, what it adds to the gradient to first
    order is included."""
    n, data = len(motion.positions), tangent.matrix.data
    gradient, stiff = np.zeros((n, 6)), np.zeros((n, 6))
    blocks = np.zeros((len(tangent.pairs), 4, 3, 4, 3))
    data[:] = 0.0
    clamped, guards = structure.clamped, structure.guards
    assemble(
        structure.sections, structure.elements, clamped, motion.positions, motion.rotations,
        np.zeros((n, 6)) if move is None else move,
        *tangent.where, tangent.element_slot, gradient, data,
    )  # fmt: skip
    contact.pair_tangent(guards, tangent.pairs, motion.positions, gradient, blocks)
    nodes = structure.elements[tangent.pairs].reshape(-1, 4)
    add_pairs(nodes, blocks, clamped, *tangent.where, tangent.pair_slot, data)
    faces = np.array(motion.platens)
    contact.platen_tangent(structure.platens, faces, motion.positions, gradient, stiff[:, 1])
    stiff[clamped] = 1.0
    add_diagonal(stiff, *tangent.where, tangent.diagonal, data)
    return gradient


def newton_step(
    tangent: Tangent, gradient: np.ndarray, damping: np.ndarray | None = None
) -> np.ndarray | None:
    """-(W'' + damping)^-1 gradient (n, 6), or None where that is not positive definite."""
    from sksparse.cholmod import CholmodNotPositiveDefiniteError

    matrix = tangent.matrix
    if damping is not None:
        matrix = matrix.copy()
        add_diagonal(damping, *tangent.where, tangent.diagonal, matrix.data)
    try:
        tangent.factor.cholesky_inplace(matrix)
    except CholmodNotPositiveDefiniteError:
        return None
    step = np.empty_like(gradient)
    step[tangent.order] = tangent.factor.solve_A(-gradient[tangent.order].ravel()).reshape(-1, 6)
    return step


@njit(cache=True)
def sum_energies(s, elements, positions, rotations, parts):
    """Sum over elements of their energies (4,), into parts."""
    work, one = scratch(), np.zeros(4)
    parts[:] = 0.0
    for e in range(len(elements)):
        a, b = elements[e]
        element_energy(s, e, positions[a], rotations[a], positions[b], rotations[b], work, one)
        for k in range(4):
            parts[k] += one[k]


@njit(cache=True)
def _add_block(data, indptr, slot, column, size, block):
    """Add the first size x size entries of a block; `slot` is its node block in `column`."""
    start = indptr[column]
    height = 6 * (indptr[column + 1] - start)
    base = 36 * start + 6 * (slot - start)
    for j in range(size):
        for i in range(size):
            data[base + j * height + i] += block[i, j]


@njit(cache=True)
def assemble(s, elements, clamped, positions, rotations, move, rank, indptr, slot, gradient, data):
    """Gradient of the beams into gradient (n, 6), W'' move of clamped nodes included, and W''
    between free nodes into data."""
    work, block = scratch(), np.zeros((6, 6))
    g, h = np.zeros((2, 6)), np.zeros((2, 6, 2, 6))
    for e in range(len(elements)):
        a, b = elements[e]
        element_tangent(s, e, positions[a], rotations[a], positions[b], rotations[b], work, g, h)
        for p in range(2):
            row = elements[e, p]
            for i in range(6):
                gradient[row, i] += g[p, i]
            for q in range(2):
                column = elements[e, q]
                if clamped[column]:
                    for i in range(6):
                        for j in range(6):
                            gradient[row, i] += h[p, i, q, j] * move[column, j]
                elif not clamped[row]:
                    for i in range(6):
                        for j in range(6):
                            block[i, j] = h[p, i, q, j]
                    _add_block(data, indptr, slot[e, q, p], rank[column], 6, block)


@njit(cache=True)
def add_pairs(nodes, blocks, clamped, rank, indptr, slot, data):
    """Blocks (p, 4, 3, 4, 3) between the positions of nodes (p, 4)."""
    one = np.zeros((3, 3))
    for p in range(len(nodes)):
        if not blocks[p].any():
            continue
        for n in range(4):
            for m in range(4):
                if clamped[nodes[p, n]] or clamped[nodes[p, m]]:
                    continue
                for i in range(3):
                    for j in range(3):
                        one[i, j] = blocks[p, n, i, m, j]
                _add_block(data, indptr, slot[p, m, n], rank[nodes[p, m]], 3, one)


@njit(cache=True)
def add_diagonal(values, rank, indptr, diagonal, data):
    """Add values (n, 6) to the diagonal."""
    for a in range(len(values)):
        start = indptr[rank[a]]
        height = 6 * (indptr[rank[a] + 1] - start)
        base = 36 * start + 6 * (diagonal[rank[a]] - start)
        for i in range(6):
            data[base + i * height + i] += values[a, i]
