"""A frame of straight beam pieces: strains, forces and stiffness under a finite motion.

A piece of reference chord L t between nodes a, b has, with R_h halfway between R_a and R_b
[Simo1986],

    Gamma = (R_h^T (x_b - x_a) - L t) / L       stretch along t, shear across it
    K     = log(R_a^T R_b) / L                  twist along t, bending across it

constant along it (one-point integration, which does not lock). Sections are round: area A,
I = A^2 / 4 pi, J = 2 I. Young's modulus is one, lengths are voxels. The stiffness is that of the
material: what turning adds to it is left out.
"""

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.spatial.transform import Rotation

SHEAR_FACTOR = 0.9
"""Of a round section."""


@dataclass(frozen=True, eq=False)
class Frame:
    """Nodes at points (n, 3), pieces (m, 2) between them with sections of area (m,); voxels."""

    points: np.ndarray
    pieces: np.ndarray
    area: np.ndarray

    @property
    def chord(self) -> np.ndarray:
        """(m, 3) from end to end."""
        return np.diff(self.points[self.pieces], axis=1)[:, 0]

    @property
    def length(self) -> np.ndarray:
        """(m,) of the pieces."""
        return np.linalg.norm(self.chord, axis=1)

    @property
    def radius(self) -> np.ndarray:
        """(m,) of the round sections of the pieces."""
        return np.sqrt(self.area / np.pi)

    @property
    def radius_at_nodes(self) -> np.ndarray:
        """(n,) of the pieces that meet at a node, on average; zero where there is none."""
        ends, count = self.pieces.ravel(), len(self.points)
        total = np.bincount(ends, np.repeat(self.radius, 2), count)
        return total / np.maximum(np.bincount(ends, minlength=count), 1)

    @property
    def dofs(self) -> np.ndarray:
        """(m, 12): three of translation and three of rotation for either end."""
        return (6 * self.pieces[:, :, None] + np.arange(6)).reshape(len(self.pieces), 12)


@dataclass(frozen=True, eq=False)
class FrameMotion:
    """Where the nodes are, (n, 3), and how they have turned, (n, 3, 3)."""

    positions: np.ndarray
    rotations: np.ndarray

    def moved(self, step: np.ndarray) -> "FrameMotion":
        """After a step (n, 6): a translation, and a turn as a spatial rotation vector."""
        turn = Rotation.from_rotvec(step[:, 3:]).as_matrix()
        return FrameMotion(self.positions + step[:, :3], turn @ self.rotations)


def at_rest(frame: Frame) -> FrameMotion:
    """The reference."""
    return FrameMotion(frame.points.copy(), np.tile(np.eye(3), (len(frame.points), 1, 1)))


def moduli(frame: Frame, nu: float) -> np.ndarray:
    """(m, 6, 6) from (Gamma, K) to force and moment; nu: Poisson's ratio."""
    area, inertia, shear = frame.area, frame.area**2 / (4 * np.pi), 0.5 / (1 + nu)
    tangent = frame.chord / frame.length[:, None]
    along = np.einsum("ei,ej->eij", tangent, tangent)
    across = np.eye(3) - along
    out = np.zeros((len(area), 6, 6))
    for block, axial, lateral in (
        (slice(0, 3), area, SHEAR_FACTOR * shear * area),
        (slice(3, 6), 2 * shear * inertia, inertia),
    ):
        out[:, block, block] = axial[:, None, None] * along + lateral[:, None, None] * across
    return out


def skew(v: np.ndarray) -> np.ndarray:
    """(..., 3, 3) with skew(v) w = v x w for v (..., 3)."""
    return np.cross(v[..., None, :], np.eye(3), axis=-1).swapaxes(-1, -2)


def strains(frame: Frame, motion: FrameMotion) -> tuple[np.ndarray, np.ndarray]:
    """(Gamma, K) (m, 6) of the pieces, and what a step of their nodes adds, (m, 6, 12)."""
    first, second = (motion.rotations[frame.pieces[:, k]] for k in (0, 1))
    half = Rotation.from_matrix(first.swapaxes(1, 2) @ second).as_rotvec() / 2
    back = (first @ Rotation.from_rotvec(half).as_matrix()).swapaxes(1, 2)
    piece = np.diff(motion.positions[frame.pieces], axis=1)[:, 0]
    length = frame.length[:, None]
    found = np.hstack([
        (np.einsum("eij,ej->ei", back, piece) - frame.chord) / length, 2 * half / length
    ])  # fmt: skip
    rate, lever = back / length[..., None], back @ skew(piece) / (2 * length[..., None])
    slopes = np.zeros((len(piece), 6, 12))
    slopes[:, :3, :3], slopes[:, :3, 6:9] = -rate, rate
    slopes[:, :3, 3:6], slopes[:, :3, 9:] = lever, lever
    slopes[:, 3:, 3:6], slopes[:, 3:, 9:] = -rate, rate
    return found, slopes


def energies(frame: Frame, strain: np.ndarray, nu: float) -> np.ndarray:
    """(m,) of the pieces with strains (m, 6)."""
    return 0.5 * frame.length * np.einsum("ei,eij,ej->e", strain, moduli(frame, nu), strain)


def forces(frame: Frame, motion: FrameMotion, nu: float) -> tuple[np.ndarray, sparse.csr_matrix]:
    """What the pieces load their nodes with, (6 n,), and the stiffness (6 n, 6 n)."""
    strain, slopes = strains(frame, motion)
    elastic = moduli(frame, nu) * frame.length[:, None, None]
    load = np.einsum("eip,eij,ej->ep", slopes, elastic, strain, optimize=True)
    stiff = np.einsum("eip,eij,ejq->epq", slopes, elastic, slopes, optimize=True)
    dofs, size = frame.dofs, 6 * len(frame.points)
    rows, columns = np.repeat(dofs, 12, axis=1).ravel(), np.tile(dofs, (1, 12)).ravel()
    matrix = sparse.coo_matrix((stiff.ravel(), (rows, columns)), shape=(size, size)).tocsr()
    return np.bincount(dofs.ravel(), load.ravel(), size), matrix
