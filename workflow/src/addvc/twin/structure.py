"""The network as mechanics: sections of its beams, clamped nodes, what may touch what."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import contact
from .beam import Sections
from .contact import Guards, Platens
from .kernels import LOBE
from .options import TwinOptions
from .struts import Network, platen_nodes

POISSON = 0.3
SHEAR_FACTOR = 0.9
"""Of a circular section."""
FOLD = 0.4
"""Strain at the surface beyond which a hinging strut is as stiff as at rest: it folds no tighter."""


@dataclass(frozen=True, eq=False)
class Structure:
    """elements (m, 2), their sections, which nodes (n,) are clamped to a platen, the reference
    nodes (n, 3) and the guards of contact. Young's modulus is one, lengths are voxels."""

    elements: np.ndarray
    sections: Sections
    clamped: np.ndarray
    reference: np.ndarray
    guards: Guards
    platens: Platens


def sections(network: Network, options: TwinOptions) -> Sections:
    """Moduli of the beams: area pi r^2 (1 + a^2 / 2), inertia pi r^4 / 4 (1 + 3 a^2) for a
    three-lobed section r (1 + a cos 3 theta); its inertia is the same about any axis."""
    chord = np.diff(network.nodes[network.elements], axis=1)[:, 0]
    length = np.linalg.norm(chord, axis=1)
    square, fourth = ((network.radii**power).mean(axis=1) for power in (2, 4))
    area = np.pi * square * (1 + LOBE**2 / 2)
    inertia = np.pi / 4 * fourth * (1 + 3 * LOBE**2)
    shear = 0.5 / (1 + POISSON)
    radius, elastic = np.sqrt(square), np.full(len(length), np.inf)
    hinging = options.material == "hinging"
    return Sections(
        length,
        chord / length[:, None],
        area,
        SHEAR_FACTOR * shear * area,
        2 * shear * inertia,
        inertia,
        options.hinge_strain / radius if hinging else elastic,
        FOLD / radius if hinging else elastic,
        options.hardening,
    )


def structure(network: Network, options: TwinOptions) -> Structure:
    """The network between its platens; struts that end on one are clamped to it."""
    clamped = np.zeros(len(network.nodes), dtype=bool)
    clamped[np.concatenate(platen_nodes(network))] = True
    beams = network.elements, network.radii
    faces = (network.body.low, network.body.high)
    return Structure(
        network.elements,
        sections(network, options),
        clamped,
        network.nodes,
        contact.guards(*beams),
        contact.platens(*beams, network.nodes, faces),
    )
