"""The exact displacement of any material point of the synthetic test.

For a point X and a beam element e near it: t = clipped projection on the element,
zeta = X - r0_e(t), and u(X) = sum_e w_e [r_e(t) + R_e(t) zeta] - X, with r_e the cubic Hermite of
the deformed centre line, R_e(t) = R_a exp(t log(R_a^T R_b)), w_e ~ exp(-3 (d_e - d_min)) and d_e
the distance to the surface of e. All struts of a junction move alike there, so u is continuous.
"""

from __future__ import annotations

import os
from collections.abc import Callable

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from . import kernels
from .geometry import REACH, beams, bend, cell_list, far_list
from .kernels import Cells
from .motion import Motion
from .store import load_foam, load_motions, load_strains
from .struts import Network, junctions


class Truth:
    """Displacements between the reference and each state, voxels of the binned image.

    network: the reference beams; strains: nominal, per state, 0 first; platens (states, 2): y of
    both faces; junctions (n, 3): where struts meet in the reference.
    """

    def __init__(self, network: Network, motions: list[Motion], strains: tuple[float, ...]) -> None:
        if len(motions) != len(strains):
            raise ValueError(
                f"{len(motions)} motions do not match {len(strains)} strains; both count the "
                "reference as their first"
            )
        self.network, self.motions, self.strains = network, motions, tuple(strains)
        self.platens = np.array([m.platens for m in motions])
        self.junctions = junctions(network)
        self._beams = beams(network)
        self._cells = cell_list(self._beams, network.body.shape)
        self._tree = cKDTree(self._beams.start + 0.5 * self._beams.chord)
        self._bent = {}

    @classmethod
    def load(cls, path: str | os.PathLike) -> Truth:
        """From a file of `save_motions`."""
        return cls(load_foam(path), load_motions(path), load_strains(path))

    @property
    def states(self) -> int:
        """How many loading states it has."""
        return len(self.motions) - 1

    def displacement(self, points: np.ndarray, state: int) -> np.ndarray:
        """u (n, 3) of reference points (n, 3), voxels: I_reference(x) = I_state(x + u(x)).

        Raises ValueError where there is no such state (0: the reference), or points are not (n, 3).
        """
        points = _as_points(points)
        if not 0 <= state < len(self.motions):
            raise ValueError(f"state {state} is outside 0 to {len(self.motions) - 1}")
        if state not in self._bent:
            self._bent[state] = bend(self.network, self.motions[state])
        b, p = self._beams, self._bent[state]
        return self._near(points, lambda cells, i, x: kernels.place(b, p, cells, i, x)) - points

    def rotation_angles(self, state: int) -> np.ndarray:
        """(m,) by how many degrees each beam has turned."""
        ends = self.motions[state].rotations[self.network.elements]
        angles = Rotation.from_matrix(ends.reshape(-1, 3, 3)).magnitude()
        return np.degrees(angles.reshape(-1, 2).mean(axis=1))

    def strut(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Nearest strut (n,), its unit tangent (n, 3) and the distance (n,) to its surface."""
        found = self._near(_as_points(points), self._closest)
        element = found[:, 0].astype(np.int64)
        tangent = self._beams.chord * np.sqrt(self._beams.inverse2)[:, None]
        return self.network.strut[element], tangent[element], found[:, 1]

    def _closest(self, cells: Cells, cell_of: np.ndarray, points: np.ndarray) -> np.ndarray:
        """(n, 2): nearest element and distance."""
        return np.stack(kernels.closest(self._beams, cells, cell_of, points), axis=1)

    def _near(self, points: np.ndarray, evaluate: Callable) -> np.ndarray:
        """evaluate(cells, cell_of, points) with the cell list where it holds, else a tree."""
        cells = self._cells
        cell_of = kernels.cells_of(cells, points)
        in_reach = cells.first[cell_of + 1] > cells.first[cell_of]
        listed = np.flatnonzero(in_reach)
        if len(listed):
            _, d = kernels.closest(self._beams, cells, cell_of[listed], points[listed])
            in_reach[listed] = d < REACH
        near, far = np.flatnonzero(in_reach), np.flatnonzero(~in_reach)
        parts = []
        if len(near):
            parts.append((near, evaluate(cells, cell_of[near], points[near])))
        if len(far):
            own = far_list(self._beams, points[far], self._tree)
            parts.append((far, evaluate(own, np.arange(len(far)), points[far])))
        width = parts[0][1].shape[1] if parts else 3
        out = np.empty((len(points), width))
        for index, value in parts:
            out[index] = value
        return out


def _as_points(points: np.ndarray) -> np.ndarray:
    points = np.ascontiguousarray(points, dtype=float)
    if points.ndim != 2 or points.shape[1] != 3:
        raise ValueError(f"points have shape {points.shape}, (n, 3) is needed")
    return points
