"""How hard a synthetic test is: what the best field that a mesh can hold would leave.

The truth is projected on each mesh (least squares over the solid), so that what a mesh misses is told
apart from what a method misses. For judging only.
"""

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from addvc.analysis.truth import Judge
from addvc.correlation.gauss_newton import rms
from addvc.correlation.metric import Reference, residual_at, residual_statistics
from addvc.correlation.transfer import Projection, transfer_matrix
from addvc.fem.mesh import Mesh


def beyond_affine(points: np.ndarray, u: np.ndarray) -> float:
    """rms of u (n, 3) at points (n, 3) after the best affine field is taken off, voxels."""
    base = np.column_stack([points, np.ones(len(points))])
    return rms(u - base @ np.linalg.lstsq(base, u, rcond=None)[0])


@dataclass(frozen=True, eq=False)
class Best:
    """The best field of a mesh, and what it is at the nodes (n,) of the struts."""

    project: Projection
    at_nodes: sparse.csr_matrix

    def __call__(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """u (Q, 3) -> its projection at the points (Q, 3) and at the nodes (n, 3)."""
        nodal = self.project.nodal(u)
        return self.project.at_points @ nodal, self.at_nodes @ nodal

    @classmethod
    def of(cls, mesh: Mesh, points: np.ndarray, weight: np.ndarray, nodes: np.ndarray) -> "Best":
        """From points (Q, 3) with weights (Q,), seen there and at nodes (n, 3)."""
        return cls(Projection(mesh, points, weight), transfer_matrix(mesh, nodes)[0])


def projections(reference: Reference, nodes: np.ndarray, meshes: dict[str, Mesh]) -> dict:
    """The best field of each mesh from the micro quadrature, seen there and at nodes (n, 3)."""
    q = reference.quadrature
    return {name: Best.of(mesh, q.points, q.weight, nodes) for name, mesh in meshes.items()}


def difficulty(
    truth: Judge,
    reference: Reference,
    deformed: np.ndarray,
    state: int,
    nodes: np.ndarray,
    best: dict[str, Best],
) -> dict:
    """What is left of a state with the spline coefficients `deformed`: sigma(r) at the micro
    quadrature (grey levels) and rms at nodes (n, 3) of the struts (voxels), at rest, under the truth,
    beyond an affine field and beyond the best field of each mesh; how far struts turn (degrees)."""

    def sigma(u):
        r, inside = residual_at(reference, deformed, u)
        return residual_statistics(r, inside, reference.quadrature.weight)["std"]

    points = reference.quadrature.points
    at_points, at_nodes = (truth.displacement(x, state) for x in (points, nodes))
    figures = {
        "state": state,
        "sigma": {"rest": sigma(np.zeros_like(points)), "truth": sigma(at_points)},
        "beyond": {"affine": beyond_affine(nodes, at_nodes)},
    }
    for name, best_field in best.items():
        held, held_nodes = best_field(at_points)
        figures["sigma"][name] = sigma(held)
        figures["beyond"][name] = rms(held_nodes - at_nodes)
    if hasattr(truth, "rotation_angles"):
        angles = truth.rotation_angles(state)
        figures["rotation"] = dict(
            zip(("median", "p95"), map(float, np.percentile(angles, (50, 95))), strict=True)
        )
    return figures
