"""The motion of a strut from the displacement of its nodes, as that of a geometrically exact beam.

The section at s of the centre line c moves to r(s) and turns by R(s); with t the reference tangent,

    K     = axial(R^T R')     twist along t, bending across it
    Gamma = R^T r' - t        stretch along t, shear across it

[Simo1986]. A strut loaded at its ends only, of uniform section, has bending that is linear in s, and
twist, stretch and shear that are constant: these 8 coefficients and the 6 of a rigid motion are fitted
to the nodes of the strut, x = r(s) + R(s) (X - c(s)), by least squares weighted with volume. Rotations
are finite, so that a rigid motion has no strain. The scatter of the nodes about the fit gives a
covariance of the coefficients, by leaving out one slice after the other (a jackknife), since errors of
neighbours go together. What the noise of the images does is known apart: it moves whole ends.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from addvc.analysis.struts import Strut

TWIST, BENDING, STRETCH, SHEAR = slice(0, 1), slice(1, 5), slice(5, 6), slice(6, 8)
"""Where the coefficients are: twist, bending (constant and linear, about two axes), stretch, shear."""

CURVATURES, STRAINS, RIGID = 5, 3, 6

ITERATIONS = 15
"""Of Gauss-Newton, at most: three to six are enough."""

SETTLED = 1e-8
"""Largest step of a coefficient at the end, in voxels, radians and their ratios."""


@dataclass(frozen=True, eq=False)
class Beam:
    """A strut in the reference, in g - 1 pieces between stations (g, 3): chords (g - 1, 3), lengths
    (g - 1,), tangent and two normals (3, g - 1, 3), shapes (8, g - 1, 3) of K and Gamma."""

    stations: np.ndarray
    chord: np.ndarray
    length: np.ndarray
    frame: np.ndarray
    shapes: np.ndarray

    @classmethod
    def of(cls, strut: Strut) -> "Beam":
        chord = np.diff(strut.points, axis=0)
        length = np.linalg.norm(chord, axis=1)
        frame = frames(chord / length[:, None])
        t, first, second = frame
        x = np.linspace(-1, 1, len(chord))[:, None]
        shapes = np.stack([t, first, x * first, second, x * second, t, first, second])
        return cls(strut.points, chord, length, frame, shapes)


def frames(tangent: np.ndarray) -> np.ndarray:
    """Tangents (k, 3) with two unit normals each: (3, k, 3), turning as little as the tangent does."""
    axis = np.eye(3)[np.abs(tangent.mean(axis=0)).argmin()]
    first = axis - (tangent @ axis)[:, None] * tangent
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([tangent, first, np.cross(tangent, first)])


@dataclass(frozen=True, eq=False)
class Motion:
    """Positions (g, 3) and rotations (g, 3, 3) of the stations; of the middle of each piece the
    rotation (g - 1, 3, 3), and the piece itself (g - 1, 3) as it is now."""

    positions: np.ndarray
    rotations: np.ndarray
    halfway: np.ndarray
    piece: np.ndarray


@dataclass(frozen=True, eq=False)
class StrutMotion:
    """Coefficients (8,) of twist and bending (1/voxel), stretch and shear; their covariance (8, 8) by
    the scatter of the nodes about the fit, and by the noise of the images, zero where it is not known;
    `scatter`: rms distance of the nodes from the fit, voxels; `rotation`: of the middle."""

    beam: Beam
    coefficients: np.ndarray
    covariance: np.ndarray
    noise: np.ndarray
    motion: Motion
    scatter: float
    rotation: np.ndarray
    converged: bool


def strut_motion(
    strut: Strut, points: np.ndarray, u: np.ndarray, draws: np.ndarray | None = None
) -> StrutMotion:
    """The motion of a strut whose nodes at points (k, 3) are displaced by u (k, 3).

    draws (d, k, 3): displacements that the noise of the images makes in that state (turned with the
    strut, where the method is). Noise that moves a whole end leaves no scatter."""
    beam, weight = Beam.of(strut), strut.weight / strut.weight.sum()
    below = np.minimum(strut.place.astype(int), len(beam.chord) - 1)
    at = Places(below, (strut.place - below)[:, None])
    arm, now = points - at.of(beam.stations), points + u
    position, turn = rigid_motion(points, now, weight, beam.stations[_middle(beam)])
    values, converged = np.zeros(CURVATURES + STRAINS), False
    for _ in range(ITERATIONS):
        motion = integrated(beam, values, position, turn)
        error, slopes = misfit(beam, motion, at, arm, now)
        normal = np.einsum("pki,qki,k->pq", slopes, slopes, weight, optimize=True)
        push = np.einsum("pki,ki,k->p", slopes, error, weight)
        step = np.linalg.lstsq(normal, push, rcond=None)[0]
        position = position + step[:3]
        turn = Rotation.from_rotvec(step[3:6]).as_matrix() @ turn
        values = values + step[RIGID:]
        converged = bool(np.abs(step).max() < SETTLED)
        if converged:
            break
    covariance = jackknife(slopes, error, weight, sections(strut))[RIGID:, RIGID:]
    noise = np.zeros_like(covariance)
    if draws is not None:
        pushes = np.einsum("pki,dki,k->pd", slopes, draws, weight, optimize=True)
        found = np.linalg.lstsq(normal, pushes, rcond=None)[0][RIGID:]
        noise = found @ found.T / len(draws)
    scatter = float(np.sqrt(weight @ (error**2).sum(axis=1)))
    return StrutMotion(beam, values, covariance, noise, motion, scatter, turn, converged)


def _middle(beam: Beam) -> int:
    return len(beam.stations) // 2


def rigid_motion(
    points: np.ndarray, now: np.ndarray, weight: np.ndarray, at: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The rigid motion nearest to points (k, 3) that are `now` elsewhere: where `at` (3,) goes, and
    the rotation (3, 3) [Kabsch1976]."""
    before, after = weight @ points, weight @ now
    turn, _ = Rotation.align_vectors(now - after, points - before, weights=weight)
    return after + turn.apply(at - before), turn.as_matrix()


@dataclass(frozen=True, eq=False)
class Places:
    """Where nodes (k,) are between the stations: the one below (k,) and the share (k, 1) beyond."""

    below: np.ndarray
    share: np.ndarray

    def of(self, values: np.ndarray) -> np.ndarray:
        """Values (..., g, 3) of the stations at the nodes (..., k, 3)."""
        low, high = values[..., self.below, :], values[..., self.below + 1, :]
        return low + self.share * (high - low)


def integrated(beam: Beam, values: np.ndarray, position: np.ndarray, turn: np.ndarray) -> Motion:
    """The motion with coefficients (8,) whose middle station is at `position` (3,), turned by `turn`
    (3, 3): R_+ = R exp(h K), r_+ = r + R exp(h K / 2) (chord + h Gamma)."""
    curvature = np.tensordot(values[:CURVATURES], beam.shapes[:CURVATURES], 1)
    strain = np.tensordot(values[CURVATURES:], beam.shapes[CURVATURES:], 1)
    h, m = beam.length[:, None], _middle(beam)
    half = Rotation.from_rotvec(h * curvature / 2).as_matrix()
    whole = half @ half
    rotations = np.empty((len(beam.stations), 3, 3))
    rotations[m] = turn
    for g in range(m, len(whole)):
        rotations[g + 1] = rotations[g] @ whole[g]
    for g in range(m, 0, -1):
        rotations[g - 1] = rotations[g] @ whole[g - 1].T
    halfway = rotations[:-1] @ half
    piece = np.einsum("gij,gj->gi", halfway, beam.chord + h * strain)
    return Motion(position + from_middle(piece), rotations, halfway, piece)


def from_middle(steps: np.ndarray) -> np.ndarray:
    """Sums (..., g, 3) of steps (..., g - 1, 3) between stations, zero at the middle station."""
    sums = np.cumsum(steps, axis=-2)
    sums = np.concatenate([np.zeros_like(sums[..., :1, :]), sums], axis=-2)
    middle = sums.shape[-2] // 2
    return sums - sums[..., middle : middle + 1, :]


def misfit(
    beam: Beam, motion: Motion, at: Places, arm: np.ndarray, now: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """How far nodes with arms (k, 3) from the centre line are from where they are `now` (k, 3), and
    by how much each parameter would move them (14, k, 3): 3 of the middle station, 3 of its
    rotation, 8 coefficients."""
    h = beam.length[None, :, None]
    inner = h * np.einsum("gij,pgj->pgi", motion.halfway, beam.shapes)
    count, g = RIGID + CURVATURES + STRAINS, len(beam.stations)
    spin, shift = np.zeros((count, g, 3)), np.zeros((count, g - 1, 3))
    spin[3:6] = np.eye(3)[:, None]
    spin[RIGID : RIGID + CURVATURES] = from_middle(inner[:CURVATURES])
    shift[RIGID + CURVATURES :] = inner[CURVATURES:]
    shift += np.cross((spin[:, 1:] + spin[:, :-1]) / 2, motion.piece)
    moved = from_middle(shift)
    moved[:3] += np.eye(3)[:, None]
    low, high = motion.rotations[at.below], motion.rotations[at.below + 1]
    turned = np.einsum("kij,kj->ki", low + at.share[..., None] * (high - low), arm)
    error = now - at.of(motion.positions) - turned
    return error, at.of(moved) + np.cross(at.of(spin), turned)


def sections(strut: Strut) -> np.ndarray:
    """Which slice (k,) of the strut each node is in; slices are about a radius long."""
    count = max(3, round(strut.span / strut.radius))
    place = strut.place / (len(strut.points) - 1)
    return np.minimum((count * place).astype(int), count - 1)


def jackknife(
    slopes: np.ndarray, error: np.ndarray, weight: np.ndarray, label: np.ndarray
) -> np.ndarray:
    """Covariance (p, p) of a least-squares fit with slopes (p, k, 3), errors (k, 3) and weights (k,),
    from what it would be without each of the slices, label (k,), in turn."""
    normal = np.einsum("pki,qki,k->pq", slopes, slopes, weight, optimize=True)
    steps = []
    for number in range(label.max() + 1):
        own = label == number
        part, w = slopes[:, own], weight[own]
        push = np.einsum("pki,ki,k->p", part, error[own], w)
        rest = normal - np.einsum("pki,qki,k->pq", part, part, w, optimize=True)
        steps.append(np.linalg.lstsq(rest, push, rcond=None)[0])
    steps = np.array(steps)
    return steps.T @ steps * (len(steps) - 1) / len(steps)
