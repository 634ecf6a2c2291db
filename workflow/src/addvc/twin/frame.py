"""Motion of the beam network under compression, from linear steps on its current geometry.

Each step is the linear elastic response of a space frame to a small move of the upper platen; the
geometry is then updated and the stress forgotten, as in a creeping network. It is not an
equilibrium path of an elastic foam, yet struts bend rather than stretch at any strain. Whatever
replaces it must only return the same `Motion`s.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array, csc_array
from scipy.spatial.transform import Rotation
from sksparse.cholmod import cholesky

from .options import TwinOptions
from .struts import Network, platen_nodes

POISSON = 0.3
SHEAR_FACTOR = 0.9
"""Of a circular section."""


@dataclass(frozen=True)
class Motion:
    """One state: positions (n, 3) of the beam nodes, voxels; rotations (n, 3, 3) from the
    reference; platens (2,): y of the faces of the lower and upper platen."""

    positions: np.ndarray
    rotations: np.ndarray
    platens: tuple[float, float]


def at_rest(network: Network) -> Motion:
    """The reference state."""
    eye = np.broadcast_to(np.eye(3), (len(network.nodes), 3, 3)).copy()
    return Motion(network.nodes.copy(), eye, (network.body.low, network.body.high))


def element_axes(nodes: np.ndarray, elements: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Axes (m, 3, 3), rows, the first along the element, and lengths (m,)."""
    along = nodes[elements[:, 1]] - nodes[elements[:, 0]]
    length = np.linalg.norm(along, axis=1)
    e1 = along / length[:, None]
    helper = np.eye(3)[np.abs(e1).argmin(axis=1)]
    e2 = np.cross(e1, helper)
    e2 /= np.linalg.norm(e2, axis=1)[:, None]
    return np.stack([e1, e2, np.cross(e1, e2)], axis=1), length


def local_stiffness(length: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """(m, 12, 12) Timoshenko beams of circular section, Young's modulus 1 [Przemieniecki1968].

    Degrees of freedom: u, v, w, three rotations at the first end, then the same at the second.
    """
    area, inertia = np.pi * radius**2, np.pi / 4 * radius**4
    shear = 0.5 / (1 + POISSON)
    phi = 12 * inertia / (SHEAR_FACTOR * shear * area * length**2)
    k = np.zeros((len(length), 12, 12))
    axial, torsion = area / length, shear * 2 * inertia / length
    for dof, value in ((0, axial), (3, torsion)):
        k[:, dof, dof] = k[:, dof + 6, dof + 6] = value
        k[:, dof, dof + 6] = k[:, dof + 6, dof] = -value
    bend = inertia / (length**3 * (1 + phi))
    for v, r, sign in ((1, 5, 1.0), (2, 4, -1.0)):
        index = np.array([v, r, v + 6, r + 6])
        k[:, index[:, None], index] = bending_block(bend, length, phi, sign)
    return k


def bending_block(bend: np.ndarray, length: np.ndarray, phi: np.ndarray, sign: float) -> np.ndarray:
    """(m, 4, 4) for deflection and rotation at both ends; sign of rotation against slope."""
    one, half = 12 * np.ones_like(length), sign * 6 * length
    near, far = (4 + phi) * length**2, (2 - phi) * length**2
    rows = [
        [one, half, -one, half],
        [half, near, -half, far],
        [-one, -half, one, -half],
        [half, far, -half, near],
    ]
    return bend[:, None, None] * np.stack([np.stack(r, axis=-1) for r in rows], axis=1)


def stiffness(nodes: np.ndarray, elements: np.ndarray, radii: np.ndarray) -> csc_array:
    """(6n, 6n) stiffness; six degrees of freedom a node: translation, rotation."""
    axes, length = element_axes(nodes, elements)
    k = local_stiffness(length, radii.mean(axis=1)).reshape(-1, 4, 3, 4, 3)
    k = np.einsum("epi,eapbq,eqj->eaibj", axes, k, axes, optimize=True)
    dof = (6 * elements[:, :, None] + np.arange(6)).reshape(-1, 12)
    rows, columns = np.repeat(dof, 12, axis=1).ravel(), np.tile(dof, (1, 12)).ravel()
    n = 6 * len(nodes)
    return coo_array((k.ravel(), (rows, columns)), shape=(n, n)).tocsc()


def solve_frame(
    k: csc_array, fixed: np.ndarray, value: np.ndarray, load: np.ndarray | None = None
) -> np.ndarray:
    """Displacement (6n,) with degrees of freedom fixed (bool (6n,)) at value (6n,)."""
    u = np.where(fixed, value, 0.0)
    free = np.flatnonzero(~fixed)
    right = (0.0 if load is None else load) - k @ u
    u[free] = cholesky(k[free][:, free].tocsc())(right[free])
    return u


def contact_planes(network: Network, platens: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """(n,) least and greatest y of each node: its surface touches the platen there."""
    reach = np.zeros(len(network.nodes))
    np.maximum.at(reach, network.elements, network.radii)
    return platens[0] + reach, platens[1] - reach


def platen_conditions(
    network: Network, motion: Motion, move: float
) -> tuple[np.ndarray, np.ndarray]:
    """fixed, value (n, 6): clamped ends; nodes that touch a platen follow it along y."""
    n = len(network.nodes)
    fixed, value = np.zeros((n, 6), bool), np.zeros((n, 6))
    low, high = platen_nodes(network)
    fixed[low], fixed[high], value[high, 1] = True, True, -move
    least, greatest = contact_planes(network, motion.platens)
    y = motion.positions[:, 1]
    fixed[(y <= least) | (y >= greatest), 1] = True
    value[y >= greatest, 1] = -move
    return fixed, value


def step(network: Network, motion: Motion, move: float) -> np.ndarray:
    """(n, 6) linear response; nodes that would enter a platen stop at it, in a second solution."""
    k = stiffness(motion.positions, network.elements, network.radii)
    fixed, value = platen_conditions(network, motion, move)
    u = solve_frame(k, fixed.ravel(), value.ravel()).reshape(-1, 6)
    y, (low, high) = motion.positions[:, 1], motion.platens
    least, greatest = contact_planes(network, (low, high - move))
    entering = ~fixed[:, 1] & ((y + u[:, 1] < least) | (y + u[:, 1] > greatest))
    if entering.any():
        fixed[entering, 1] = True
        value[entering, 1] = (np.clip(y + u[:, 1], least, greatest) - y)[entering]
        u = solve_frame(k, fixed.ravel(), value.ravel()).reshape(-1, 6)
    return u


def advance(network: Network, motion: Motion, move: float) -> Motion:
    """Move the upper platen by -move (voxels) along y and update the geometry."""
    u = step(network, motion, move)
    turn = Rotation.from_rotvec(u[:, 3:]).as_matrix()
    platens = (motion.platens[0], motion.platens[1] - move)
    positions = motion.positions + u[:, :3]
    positions[:, 1] = np.clip(positions[:, 1], *platens)
    return Motion(positions, turn @ motion.rotations, platens)


def deform(network: Network, options: TwinOptions) -> list[Motion]:
    """Motions of the reference (first) and of each state of options.strains."""
    motions = [at_rest(network)]
    for start, end in zip((0.0, *options.strains), options.strains, strict=False):
        steps = int(np.ceil((end - start) / options.step))
        motion = motions[-1]
        for _ in range(steps):
            motion = advance(network, motion, (end - start) * network.body.height / steps)
        motions.append(motion)
    return motions
