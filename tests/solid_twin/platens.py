"""Two platens: nodes that are clamped to them from the start, and those that come to touch them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Contact:
    """Frictionless platens by penalty: faces at `low` and `high` along y, stiffness per node."""

    nodes: np.ndarray
    low: float
    high: float
    stiffness: float = 10.0

    def depth(self, x: np.ndarray) -> np.ndarray:
        """(k,) signed penetration of the nodes that may touch: above 0 in the lower platen, below
        0 in the upper one."""
        y = x[self.nodes, 1]
        return np.maximum(self.low - y, 0) + np.minimum(self.high - y, 0)

    def energy(self, x: np.ndarray) -> float:
        """k/2 d^2 over the nodes."""
        return 0.5 * self.stiffness * float(np.sum(self.depth(x) ** 2))

    def force(self, x: np.ndarray) -> np.ndarray:
        """(n, 3) gradient of the energy."""
        force = np.zeros_like(x)
        force[self.nodes, 1] = -self.stiffness * self.depth(x)
        return force

    def change(self, x: np.ndarray, after: Contact) -> np.ndarray:
        """(n, 3) change of the force when the faces move and the nodes in contact stay the same."""
        depth, force = self.depth(x), np.zeros_like(x)
        moved = (depth > 0) * (after.low - self.low) + (depth < 0) * (after.high - self.high)
        force[self.nodes, 1] = -self.stiffness * moved
        return force

    def touching(self, x: np.ndarray) -> np.ndarray:
        """Nodes in contact."""
        return self.nodes[self.depth(x) != 0]


@dataclass(frozen=True)
class Press:
    """Two platens that touch a body at `low` and `high` (y, voxels); the upper one comes down."""

    low: float
    high: float
    contact: bool = True

    def held(self, points: np.ndarray) -> np.ndarray:
        """(n,) nodes in a platen from the start: clamped to it."""
        return (points[:, 1] <= self.low) | (points[:, 1] >= self.high)

    def shift(self, points: np.ndarray, strain: float) -> np.ndarray:
        """(n, 3) motion of the nodes clamped to the upper platen."""
        out = np.zeros_like(points)
        out[points[:, 1] >= self.high, 1] = -strain * (self.high - self.low)
        return out

    def on(self, nodes: np.ndarray, strain: float) -> Contact | None:
        """Contact of the other nodes (k,) with both faces."""
        high = self.high - strain * (self.high - self.low)
        return Contact(nodes, self.low, high) if self.contact else None

    def force(self, gradient: np.ndarray, points: np.ndarray, contact: Contact | None, x) -> float:
        """What the upper platen presses with: the gradient (n, 3) of the energy on the nodes clamped
        to it, and contact at positions x (n, 3)."""
        total = gradient[points[:, 1] >= self.high, 1].sum()
        if contact:
            total += contact.stiffness * np.minimum(contact.depth(x), 0).sum()
        return -float(total)
