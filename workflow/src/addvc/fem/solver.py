"""One interface to linear solvers: factorise(A) -> Factor, conjugate_gradients(A), both with .solve(b).

The factor is plain arrays, so that it can be stored once a mesh and used by every loading state.

Backend: CHOLMOD in double precision. The order of elimination is nested dissection (METIS) of the
node graph of A's own pattern (3 x 3 blocks): for K that is the 1-ring, for K^T D K the 2-ring. With
the 1-ring ordering on K^T D K the factor would be 18 times fuller, with AMD twice.
"""

from dataclasses import dataclass

import numba as nb
import numpy as np
from scipy import sparse

from addvc.errors import CorrelationError

LEAST_PIVOT = 1e-12

DIRECT = 150_000
"""Unknowns: the factor of a meso mesh takes some 3 GB, that of three times as many 11."""

ACCURACY = 1e-10  # of conjugate gradients, |b - A x| / |b|
MOST_STEPS = 2000
NOT_HELD = (
    "the system of {} unknowns is not positive definite ({}): some nodes are held neither by grey "
    "levels nor by regularisation; use larger elements or a longer regularisation length"
)


@dataclass(frozen=True, eq=False)
class Factor:
    """P A P^T = L L^T: `lower` is L (N, N) csc with sorted rows, `order` (N,) the permutation."""

    lower: sparse.csc_matrix
    order: np.ndarray

    @property
    def nonzeros(self) -> int:
        return int(self.lower.nnz)

    def solve(self, b: np.ndarray) -> np.ndarray:
        """x (N,) of A x = b (N,)."""
        x = np.empty(len(b))
        x[self.order] = triangular_solves(
            self.lower.data,
            self.lower.indices,
            self.lower.indptr,
            np.asarray(b, dtype=float)[self.order],
        )
        return x

    def precondition(self, r: np.ndarray) -> np.ndarray:
        """A^-1 r (N,), for a matrix that is near A."""
        return self.solve(r)


@nb.njit(cache=True)
def triangular_solves(data, indices, indptr, b):
    """L L^T x = b for L in csc, the diagonal first in each column.

    Indices are unsigned: a signed one is looked at for being negative, a third of the time."""
    x = b.copy()
    n, one = len(x), np.uint64(1)
    for j in range(n):
        start, stop = np.uint64(indptr[j]), np.uint64(indptr[j + 1])
        value = x[j] / data[start]
        x[j] = value
        for p in range(start + one, stop):
            x[np.uint64(indices[p])] -= data[p] * value
    for j in range(n - 1, -1, -1):
        start, stop = np.uint64(indptr[j]), np.uint64(indptr[j + 1])
        total = x[j]
        for p in range(start + one, stop):
            total -= data[p] * x[np.uint64(indices[p])]
        x[j] = total / data[start]
    return x


def dissection(matrix: sparse.spmatrix, block: int = 3) -> np.ndarray:
    """Order of elimination (N,) by nested dissection of the graph of block x block entries."""
    import pymetis  # loaded where it is needed: many jobs only read a factor

    nodes = sparse.bsr_matrix(matrix, blocksize=(block, block))
    graph = sparse.csr_matrix(
        (np.ones(len(nodes.indices), dtype=np.int8), nodes.indices, nodes.indptr),
        shape=(matrix.shape[0] // block,) * 2,
        copy=True,
    )  # the next lines work in place
    graph.setdiag(0)
    graph.eliminate_zeros()
    if graph.nnz == 0:
        return np.arange(matrix.shape[0])
    neighbours = pymetis.CSRAdjacency(graph.indptr, graph.indices)
    order, _ = pymetis.nested_dissection(adjacency=neighbours)
    return (block * np.asarray(order)[:, None] + np.arange(block)).ravel()


def factorise(matrix: sparse.spmatrix, order: np.ndarray | None = None) -> Factor:
    """Cholesky factor of a symmetric positive definite matrix (3 n, 3 n).

    Raises CorrelationError when it is not positive definite: some unknowns are tied neither by
    the image nor by the regularisation."""
    from sksparse.cholmod import CholmodNotPositiveDefiniteError, cholesky

    order = dissection(matrix) if order is None else order
    permuted = matrix.tocsc()[order][:, order]
    try:
        lower = cholesky(permuted, ordering_method="natural", mode="auto").L()
        pivot = float(np.min(lower.diagonal() ** 2 / permuted.diagonal()))
        if not pivot > LEAST_PIVOT:
            raise CholmodNotPositiveDefiniteError(f"a pivot fell to {pivot:.1e} of its diagonal")
    except CholmodNotPositiveDefiniteError as error:
        raise CorrelationError(NOT_HELD.format(matrix.shape[0], error)) from error
    lower.sort_indices()
    return Factor(lower, order)


@dataclass(frozen=True, eq=False)
class ConjugateGradients:
    """A x = b without a factor; `inverse` (n, 3, 3) of the diagonal blocks of A (3 n, 3 n)."""

    matrix: sparse.bsr_matrix
    inverse: np.ndarray

    @property
    def nonzeros(self) -> int:
        return int(self.matrix.nnz)

    def solve(self, b: np.ndarray) -> np.ndarray:
        """x (N,) of A x = b (N,) to ACCURACY. Raises CorrelationError where MOST_STEPS do not do."""
        from scipy.sparse.linalg import LinearOperator, cg

        if not np.isfinite(b).all():  # Gauss-Newton makes an end of it
            return np.full(len(b), np.nan)
        by_blocks = LinearOperator(self.matrix.shape, self.precondition, dtype=float)
        x, failed = cg(self.matrix, b, rtol=ACCURACY, atol=0, maxiter=MOST_STEPS, M=by_blocks)
        if failed:
            left = np.linalg.norm(b - self.matrix @ x) / np.linalg.norm(b)
            raise CorrelationError(
                f"after {MOST_STEPS} steps of conjugate gradients {left:.1e} of the right-hand side of "
                f"{len(b)} unknowns is left (limit {ACCURACY:.0e}); use larger elements or a shorter "
                "regularisation length"
            )
        return x

    def precondition(self, r: np.ndarray) -> np.ndarray:
        """D^-1 r (N,), D the 3 x 3 blocks of the diagonal."""
        return np.einsum("nij,nj->ni", self.inverse, r.reshape(-1, 3)).ravel()


def conjugate_gradients(matrix: sparse.spmatrix) -> ConjugateGradients:
    """For a positive definite matrix (3 n, 3 n) close to a mass matrix, like that of a meso mesh with a
    Laplacian of the length of its elements: some 40 steps whatever the size.

    Raises CorrelationError where a diagonal block is not positive definite."""
    blocks = sparse.bsr_matrix(matrix, blocksize=(3, 3))
    node = np.repeat(np.arange(len(blocks.indptr) - 1), np.diff(blocks.indptr))
    diagonal = np.zeros((len(blocks.indptr) - 1, 3, 3))
    at = node == blocks.indices
    diagonal[node[at]] = blocks.data[at]
    least = np.linalg.eigvalsh(diagonal).min()
    if not least > 0:
        found = f"a block of the diagonal has an eigenvalue of {least:.1e}"
        raise CorrelationError(NOT_HELD.format(matrix.shape[0], found))
    return ConjugateGradients(blocks, np.linalg.inv(diagonal))


def solver(matrix: sparse.spmatrix) -> Factor | ConjugateGradients:
    """For the system of a meso mesh: its factor up to DIRECT unknowns, conjugate gradients beyond."""
    return factorise(matrix) if matrix.shape[0] <= DIRECT else conjugate_gradients(matrix)
