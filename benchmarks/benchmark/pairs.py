"""Pairs of 96^3 whose struts move as no loaded network does: each on its own, with an exact truth.

The foam is the middle of the default twin's, cut to a cube without platens. Every junction moves by
a random vector of its own; a strut follows its ends and bows by another. Sections keep their
orientation at the ends of a strut and turn with its centre line in between. Images are those of the
twin, so that the truth is the twin's as well.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from addvc.twin import (
    Motion,
    Network,
    Specimen,
    TwinOptions,
    image,
    make_foam,
    save_motions,
    write_scan,
)
from addvc.twin.motion import at_rest

AWAY = 1e3
"""Platens stand this far outside of the image, voxels."""


@dataclass(frozen=True)
class PairOptions:
    """`side` of the cube, and `size` of the twin that it is cut from; standard deviation of each
    component of the motion of a junction and of the bow of a strut at its middle, voxels; noise in
    grey levels."""

    side: int = 96
    size: str = "default"
    junction: float = 0.8
    bow: float = 0.6
    noise: float = 2.0
    seed: int = 2417

    def twin(self) -> TwinOptions:
        """The twin that foam and images come from; one state, whose strain is a mere label."""
        plain = {"cupping": 0.0, "rings": 0.0, "drift": 0.0, "band": False}
        return TwinOptions(
            size=self.size, seed=self.seed, noise=self.noise, strains=(0.01,), **plain
        )


def cube(network: Network, side: int) -> Network:
    """The middle of a foam, side^3 voxels: nodes shifted, platens and air out of sight."""
    shift = (np.array(network.body.shape) - side) / 2
    body = Specimen((side,) * 3, -AWAY, AWAY + side - 1, AWAY)
    nodes = network.nodes - np.floor(shift)
    ends = nodes[network.elements]
    near = ((ends > -8) & (ends < side + 7)).all(axis=2).any(axis=1)
    return replace(
        network,
        nodes=nodes,
        elements=network.elements[near],
        strut=np.unique(network.strut[near], return_inverse=True)[1].astype(np.int32),
        radii=network.radii[near],
        director=network.director[near],
        body=body,
    )


def strut_nodes(network: Network) -> list[np.ndarray]:
    """The nodes along each strut, in order."""
    first = np.flatnonzero(np.diff(network.strut, prepend=-1))
    runs = np.split(network.elements, first[1:])
    return [np.r_[run[:, 0], run[-1, 1]] for run in runs]


def turned(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """(n, 3, 3) the least rotations that take directions before (n, 3) to after (n, 3)."""
    a, b = (v / np.linalg.norm(v, axis=1)[:, None] for v in (before, after))
    axis, cosine = np.cross(a, b), np.einsum("ni,ni->n", a, b)
    sine = np.linalg.norm(axis, axis=1)
    scale = np.where(sine > 1e-12, np.arctan2(sine, cosine) / np.maximum(sine, 1e-12), 1.0)
    return Rotation.from_rotvec(axis * scale[:, None]).as_matrix()


def each_on_its_own(network: Network, options: PairOptions) -> Motion:
    """Independent motions of junctions and bows of struts.

    Between the ends u = u_a + (u_b - u_a) (3 s^2 - 2 s^3) + w sin^2(pi s): no slope at the ends."""
    rng = np.random.default_rng([options.seed, 6])
    x = network.nodes
    moved = x + options.junction * rng.standard_normal(x.shape)
    rotations = at_rest(network).rotations
    for chain in strut_nodes(network):
        step = np.linalg.norm(np.diff(x[chain], axis=0), axis=1)
        s = np.r_[0, np.cumsum(step)] / step.sum()
        u = (moved - x)[chain[[0, -1]]]
        blend = (3 * s**2 - 2 * s**3)[:, None]
        bow = np.sin(np.pi * s)[:, None] ** 2 * options.bow * rng.standard_normal(3)
        moved[chain] = x[chain] + u[0] + blend * (u[1] - u[0]) + bow
        inner = chain[1:-1]
        before, after = (p[chain[2:]] - p[chain[:-2]] for p in (x, moved))
        rotations[inner] = turned(before, after)
    return Motion(moved, rotations, (network.body.low, network.body.high))


def make_pair(options: PairOptions) -> tuple[Network, list[Motion], list[np.ndarray]]:
    """Foam, motions and images of both states, the reference first."""
    twin = options.twin()
    network = cube(make_foam(twin), options.side)
    motions = [at_rest(network), each_on_its_own(network, options)]
    return network, motions, [image(network, m, twin, n) for n, m in enumerate(motions)]


def write_pair(folder: str | Path, options: PairOptions) -> None:
    """state0.tif, state1.tif and motion.h5, the truth, for a configuration with `scans`."""
    network, motions, images = make_pair(options)
    for state, volume in enumerate(images):
        write_scan(Path(folder, f"state{state}.tif"), volume)
    save_motions(Path(folder, "motion.h5"), network, motions, options.twin())
