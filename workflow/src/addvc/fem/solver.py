"""One interface to the direct solver: factorise(A) -> Factor, with .solve(b).

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


@nb.njit(cache=True)
def triangular_solves(data, indices, indptr, b):
    """L L^T x = b for L in csc, the diagonal first in each column."""
    x = b.copy()
    n = len(x)
    for j in range(n):
        x[j] /= data[indptr[j]]
        for p in range(indptr[j] + 1, indptr[j + 1]):
            x[indices[p]] -= data[p] * x[j]
    for j in range(n - 1, -1, -1):
        total = x[j]
        for p in range(indptr[j] + 1, indptr[j + 1]):
            total -= data[p] * x[indices[p]]
        x[j] = total / data[indptr[j]]
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
        raise CorrelationError(
            f"the system of {matrix.shape[0]} unknowns is not positive definite ({error}): some "
            "nodes are held neither by grey levels nor by regularisation; use larger elements or a "
            "longer regularisation length"
        ) from error
    lower.sort_indices()
    return Factor(lower, order)
