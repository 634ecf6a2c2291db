"""The test itself: the upper platen comes down step by step, the network in equilibrium at each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from . import contact
from .beam import ENERGIES
from .equilibrium import MOST, TOLERANCE, Equilibrium, EquilibriumError, descend, near, predict
from .motion import Motion, at_rest
from .options import TwinOptions
from .structure import Structure, structure
from .struts import Network
from .tangent import Tangent, energies

HALVINGS = 4
"""A load step without equilibrium is halved at most so often."""


@dataclass(frozen=True)
class LoadStep:
    """One equilibrium: nominal strain; forces of the lower and upper platen on the foam along y,
    and energies, where Young's modulus is one and lengths are voxels; nodes and pairs in contact;
    steps of the descent, trials refused on the way, rms of the last step (voxels)."""

    strain: float
    force_low: float
    force_high: float
    stretching: float
    shear: float
    torsion: float
    bending: float
    penalty: float
    contacts: int
    steps: int
    refused: int
    last_step: float


def platen_forces(structure: Structure, motion: Motion, gradient: np.ndarray) -> np.ndarray:
    """(2,) forces along y of the lower and the upper platen on the foam.

    gradient (n, 6): of the energy; at clamped nodes it is the force that holds them."""
    top = structure.clamped & (structure.reference[:, 1] > structure.reference[:, 1].mean())
    clamps = [gradient[structure.clamped & ~top, 1].sum(), gradient[top, 1].sum()]
    return np.array(clamps) + contact.platen_forces(
        structure.platens, np.array(motion.platens), motion.positions
    )


def record(structure: Structure, found: Equilibrium, strain: float) -> LoadStep:
    """What is kept of an equilibrium."""
    motion, pairs = found.motion, found.tangent.pairs
    elastic, penalty = energies(structure, motion, pairs)
    low, high = platen_forces(structure, motion, found.gradient)
    touching = contact.count(
        structure.guards, structure.platens, pairs, motion.positions, np.array(motion.platens)
    )
    shares = dict(zip(ENERGIES, map(float, elastic), strict=True))
    return LoadStep(
        strain=strain,
        force_low=float(low),
        force_high=float(high),
        **shares,
        penalty=float(penalty),
        contacts=int(touching),
        steps=found.steps,
        refused=found.refused,
        last_step=found.last_step,
    )


def load_step(
    structure: Structure, motion: Motion, tangent: Tangent | None, move: float, halvings: int = 0
) -> Equilibrium:
    """Equilibrium after the upper platen came down by `move` (voxels); halved where none is found.

    halvings: how often the step has been halved already. Raises EquilibriumError where one halved four
    times still has no equilibrium, or no damping holds the network."""
    tangent = near(structure, motion, tangent)
    found = descend(structure, predict(structure, motion, tangent, move), tangent)
    if found.reached:
        return found
    if halvings == HALVINGS:
        raise EquilibriumError(
            f"no equilibrium for a move of {move:.3f} voxels of the platen: the last of {MOST} steps "
            f"moved nodes by {found.last_step:.1e} voxel rms (limit {TOLERANCE:.0e}); lower "
            "twin.strains, or choose another twin.seed"
        )
    half = load_step(structure, motion, tangent, move / 2, halvings + 1)
    return load_step(structure, half.motion, half.tangent, move / 2, halvings + 1)


def compress(
    network: Network, options: TwinOptions, tell: Callable[[LoadStep], None] = lambda step: None
) -> tuple[list[Motion], list[LoadStep]]:
    """Motions of the reference (first) and of each state of options.strains, and every load step.

    Raises EquilibriumError where no equilibrium is found."""
    body, held, tangent = network.body, structure(network, options), None
    motions, history = [at_rest(network)], []
    for start, end in zip((0.0, *options.strains), options.strains, strict=False):
        motion, count = motions[-1], int(np.ceil((end - start) / options.step - 1e-9))
        for strain in np.linspace(start, end, count + 1)[1:]:
            face = body.high - float(strain) * body.height
            found = load_step(held, motion, tangent, motion.platens[1] - face)
            motion, tangent = found.motion, found.tangent
            history.append(record(held, found, float(strain)))
            tell(history[-1])
        motions.append(motion)
    return motions, history
