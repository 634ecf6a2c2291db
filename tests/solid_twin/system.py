"""The tangent on the free nodes, in a fixed elimination order, factorised by CHOLMOD."""

import numpy as np
from scipy import sparse
from sksparse.cholmod import CholmodNotPositiveDefiniteError, analyze

from addvc.fem.solver import dissection
from solid_twin.solid import Solid


class System:
    """K restricted to the free nodes (n,) bool of a solid; the pattern is analysed once.

    The factorisation is asked to be Cholesky's (supernodal): it fails where K is not positive
    definite, which is how an unstable equilibrium is told from a stable one."""

    def __init__(self, solid: Solid, free: np.ndarray) -> None:
        self._solid = solid
        blocks = np.arange(9 * len(solid.pattern.indices), dtype=float).reshape(-1, 3, 3)
        self.free = np.repeat(free, 3)
        numbers = solid.matrix(blocks + 1).tocsr()[self.free][:, self.free]
        self._order = dissection(numbers)
        lower = sparse.tril(numbers[self._order][:, self._order], format="csc")
        self._take = lower.data.astype(np.int64) - 1
        self._lower = lower
        self._diagonal = lower.indptr[:-1]
        self._mass = np.repeat(solid.nodal_volume, 3)[self.free][self._order]
        self._factor = analyze(lower, mode="supernodal", ordering_method="natural")

    def factorise(self, blocks: np.ndarray, damping: float = 0.0) -> bool:
        """Factorise K + damping M from the blocks (nnz, 3, 3); False where it is not positive
        definite. `damping`: energy per volume and voxel^2; M: nodal volumes."""
        data = blocks.ravel()[self._take]
        data[self._diagonal] += damping * self._mass
        lower = sparse.csc_matrix(
            (data, self._lower.indices, self._lower.indptr), self._lower.shape
        )
        try:
            self._factor.cholesky_inplace(lower)
        except CholmodNotPositiveDefiniteError:
            return False
        return True

    def solve(self, right: np.ndarray) -> np.ndarray:
        """x (n, 3), zero on held nodes, of K x = right (n, 3) by the last factor."""
        x = np.zeros(right.size)
        part = np.empty(len(self._order))
        part[self._order] = self._factor(right.ravel()[self.free][self._order])
        x[self.free] = part
        return x.reshape(-1, 3)
