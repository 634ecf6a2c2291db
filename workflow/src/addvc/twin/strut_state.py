"""What each strut of the twin undergoes: the truth that bending and stretching are judged by."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from .beam import Sections, element_energy, scratch, strains
from .motion import Motion
from .structure import Structure


class StrutStates(NamedTuple):
    """Of all struts in one state. Strains are means along the strut, curvatures and twist in
    1/voxel, energies in units of Young's modulus x voxel^3."""

    axial_strain: np.ndarray
    curvature: np.ndarray  # rms along the strut
    largest_curvature: np.ndarray
    twist: np.ndarray  # mean, signed
    stretching: np.ndarray
    shear: np.ndarray
    torsion: np.ndarray
    bending: np.ndarray


def strut_states(structure: Structure, strut: np.ndarray, motion: Motion) -> StrutStates:
    """Strains and energies of each strut from those of its elements; strut (m,) numbers them."""
    s, count = structure.sections, strut.max() + 1
    strain, energy = element_states(s, structure.elements, motion.positions, motion.rotations)
    whole = np.bincount(strut, s.length, count)

    def mean(values):
        return np.bincount(strut, s.length * values, count) / whole

    largest = np.zeros(count)
    np.maximum.at(largest, strut, strain[:, 1])
    energies = [np.bincount(strut, e, count) for e in energy.T]
    return StrutStates(
        mean(strain[:, 0]), np.sqrt(mean(strain[:, 1] ** 2)), largest, mean(strain[:, 2]), *energies
    )


@njit(cache=True)
def element_states(s: Sections, elements, positions, rotations):
    """Axial strain, curvature and twist (m, 3), and energies (m, 4), of all elements."""
    work = scratch()
    strain, energy = np.zeros((len(elements), 3)), np.zeros((len(elements), 4))
    for e in range(len(elements)):
        a, b = elements[e]
        ends = positions[a], rotations[a], positions[b], rotations[b]
        element_energy(s, e, *ends, work, energy[e])
        strains(*ends, work)
        phi, y, t, length = work.vector[0], work.vector[1], s.tangent[e], s.length[e]
        along, twist, square = 0.0, 0.0, 0.0
        for i in range(3):
            along += y[i] * t[i] / length
            twist += phi[i] * t[i] / length
            square += (phi[i] / length) ** 2
        strain[e, 0], strain[e, 2] = along - 1.0, twist
        strain[e, 1] = np.sqrt(max(square - twist * twist, 0.0))
    return strain, energy
