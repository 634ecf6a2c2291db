"""A hyperelastic solid: quadratic tetrahedra, a material, and what is constant during a motion.

Quadratic ones because linear tetrahedra of the same size make struts of 2 to 3 voxels almost twice
too stiff.
"""

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from addvc.errors import AddvcError
from addvc.fem.assembly import Pattern, block_matrix, node_pattern
from addvc.fem.elements import P2_EDGES, gauss_tet, tet_p2
from addvc.fem.mesh import Mesh, cell_volumes
from solid_twin import kernels


class SolidError(AddvcError):
    """No equilibrium was found, or the mesh cannot be computed with."""


@dataclass(frozen=True)
class Material:
    """Young's modulus (the unit of stress) and Poisson's ratio at small strain."""

    young: float = 1.0
    poisson: float = 0.35

    @property
    def lam(self) -> float:
        """First Lamé constant."""
        return self.young * self.poisson / ((1 + self.poisson) * (1 - 2 * self.poisson))

    @property
    def mu(self) -> float:
        """Shear modulus."""
        return self.young / (2 * (1 + self.poisson))


@dataclass(frozen=True, eq=False)
class Tetrahedra:
    """Quadratic tetrahedra: points (n, 3) voxels, cells (m, 10) int32 in VTK's order."""

    points: np.ndarray
    cells: np.ndarray

    @property
    def linear(self) -> Mesh:
        """The same tetrahedra by their corners; the points of edges stay in the list."""
        return Mesh(self.points, self.cells[:, :4])


def quadratic(mesh: Mesh) -> Tetrahedra:
    """Tetrahedra (m, 4) with a node added in the middle of each edge, after all corners."""
    pairs = np.sort(mesh.cells[:, P2_EDGES].reshape(-1, 2), axis=1)
    edges, number = np.unique(pairs, axis=0, return_inverse=True)
    middle = len(mesh.points) + number.reshape(-1, 6)
    points = np.vstack([mesh.points, mesh.points[edges].mean(axis=1)])
    return Tetrahedra(points, np.hstack([mesh.cells, middle]).astype(np.int32))


def corners_of_nodes(mesh: Tetrahedra) -> tuple[np.ndarray, np.ndarray]:
    """Where each node occurs: first (n + 1,) and place (10 m,), see `kernels.gathered`."""
    nodes = mesh.cells.ravel()
    count = np.bincount(nodes, minlength=len(mesh.points))
    return np.append(0, np.cumsum(count)), np.argsort(nodes, kind="stable")


class Solid:
    """Energy and its derivatives at positions x (n, 3) of the nodes of a mesh."""

    def __init__(self, mesh: Tetrahedra, material: Material | None = None) -> None:
        self.mesh, self.material = mesh, material or Material()
        self.volume = cell_volumes(mesh.linear)
        if not (self.volume > 0).all():
            raise SolidError(
                f"{(self.volume <= 0).sum()} of {len(self.volume)} tetrahedra are inverted or flat "
                "(limit 0); orient and repair the mesh"
            )
        corner = mesh.points[mesh.cells[:, :4]]
        self._inverse = np.linalg.inv((corner[:, 1:] - corner[:, :1]).swapaxes(1, 2))
        self._slopes = np.ascontiguousarray(tet_p2(gauss_tet(4)[0])[1])
        self._corners = corners_of_nodes(mesh)
        self.pattern: Pattern = node_pattern(mesh)

    @property
    def _constant(self) -> tuple:
        m = self.material
        return self.mesh.cells, self._inverse, self.volume, self._slopes, m.lam, m.mu

    @property
    def nodal_volume(self) -> np.ndarray:
        """(n,) volume of each node: a tenth of that of each of its elements."""
        share = np.repeat(self.volume / 10, 10)
        return np.bincount(self.mesh.cells.ravel(), share, len(self.mesh.points))

    def energy(self, x: np.ndarray) -> float:
        """Stored energy, infinite when an element is turned inside out."""
        return float(kernels.energies(x, *self._constant).sum())

    def force(self, x: np.ndarray) -> np.ndarray:
        """(n, 3) gradient of the energy."""
        return kernels.gathered(kernels.element_forces(x, *self._constant), *self._corners)

    def tangent(self, x: np.ndarray) -> np.ndarray:
        """(nnz, 3, 3) Hessian of the energy: blocks on `pattern`."""
        pushed = kernels.pushed_forward(x, *self._constant)
        pattern = self.pattern.slot, len(self.pattern.indices)
        return kernels.tangents(*pushed, *self._constant[1:], *self._corners, *pattern)

    def matrix(self, blocks: np.ndarray) -> sparse.bsr_matrix:
        """Blocks of `tangent` as a matrix (3 n, 3 n)."""
        return block_matrix(self.pattern, blocks)
