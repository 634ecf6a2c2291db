"""The beam element against closed forms: roll-up of a cantilever, Euler's load of a clamped column."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from . import contact
from .beam import Sections
from .motion import Motion
from .structure import Structure
from .tangent import linearise, newton_step, tangent_pattern

STIFF = 1e6
"""Axial and shear stiffness of the test beams over bending stiffness / length^2: Euler's beam."""


def straight_beam(count: int, length: float = 1.0) -> Structure:
    """`count` equal elements along y with unit bending stiffness, both ends clamped."""
    nodes = np.linspace(0, length, count + 1)[:, None] * np.array([0.0, 1.0, 0.0])
    elements = np.stack([np.arange(count), np.arange(1, count + 1)], axis=1).astype(np.int32)
    one, stiff = np.ones(count), np.full(count, STIFF / length**2)
    tangent = np.tile([0.0, 1.0, 0.0], (count, 1))
    law = Sections(
        length / count * one, tangent, stiff, stiff, one, one, np.inf * one, np.inf * one, 1.0
    )
    clamped = np.isin(np.arange(count + 1), (0, count))
    thin = np.full((count, 2), 1e-6)
    faces = contact.platens(elements, thin, nodes, (-1.0, 2.0 * length))
    return Structure(elements, law, clamped, nodes, contact.guards(elements, thin), faces)


def still(beam: Structure, positions: np.ndarray, rotations: np.ndarray | None = None) -> Motion:
    """A motion of the beam, its nodes not turned unless `rotations` (n, 3, 3) says so."""
    if rotations is None:
        rotations = np.tile(np.eye(3), (len(positions), 1, 1))
    return Motion(positions, rotations, (-1.0, 2.0))


def roll_up_error(count: int) -> float:
    """A moment 2 pi EI / L at its end bends a cantilever of length L into a circle. The largest
    force or moment out of balance in the regular polygon with `count` sides, over that moment."""
    beam = straight_beam(count)
    angle = 2 * np.pi / count
    turns = Rotation.from_rotvec(angle * np.arange(count + 1)[:, None] * [1.0, 0, 0]).as_matrix()
    middle = Rotation.from_rotvec(angle * (np.arange(count)[:, None] + 0.5) * [1.0, 0, 0])
    sides = middle.apply([0.0, 1 / count, 0])
    circle = still(beam, np.concatenate([np.zeros((1, 3)), np.cumsum(sides, axis=0)]), turns)
    none = np.zeros((0, 2), dtype=np.int32)
    forces = linearise(beam, circle, tangent_pattern(beam, none, circle.positions))
    moment = np.array([2 * np.pi, 0, 0])
    forces[0, 3:] += turns[0].T @ moment
    forces[-1, 3:] -= turns[-1].T @ moment
    return float(np.abs(forces).max() / (2 * np.pi))


def buckling_load(count: int) -> float:
    """Load at which the straight column with both ends clamped becomes unstable, over Euler's
    4 pi^2 EI / L^2; found by bisection on whether the tangent is positive definite."""
    beam = straight_beam(count)
    none = np.zeros((0, 2), dtype=np.int32)
    tangent = tangent_pattern(beam, none, beam.reference)
    low, high = 0.0, 3 * 4 * np.pi**2
    for _ in range(40):
        load = (low + high) / 2
        squeezed = beam.reference * (1 - load / STIFF)
        gradient = linearise(beam, still(beam, squeezed), tangent)
        stable = newton_step(tangent, gradient) is not None
        low, high = (load, high) if stable else (low, load)
    return low / (4 * np.pi**2)


def observed_order(coarse: int = 16) -> float:
    """Order of convergence of the buckling load, from `coarse` elements and twice as many."""
    errors = [abs(buckling_load(count) - 1) for count in (coarse, 2 * coarse)]
    return float(np.log2(errors[0] / errors[1]))
