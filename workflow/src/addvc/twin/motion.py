"""What one state of the network is: the seam between mechanics, imaging and truth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .struts import Network


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
