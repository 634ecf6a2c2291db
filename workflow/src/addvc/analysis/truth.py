"""Errors against a known truth: for judging only. Nothing that measures may import this module."""

import logging
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from addvc.analysis.mesh_truth import MeshTruth, is_mesh_truth
from addvc.errors import ConfigError, MeshError
from addvc.twin.truth import Truth
from addvc.twin.virtual import VirtualField

log = logging.getLogger(__name__)

BODY = 2.0
"""Voxels around a junction whose nodes move with it: some 1.5 radii of a strut."""

LIKE = 5.0
"""How much larger than the mesh of the struts, a part of it maybe, the solid of a truth may be."""

AWAY, FEW = 2.0, 0.05
"""Voxels that a truth can be extrapolated by; the share of nodes that may be farther."""

Judge = Truth | MeshTruth | VirtualField


def load_truth(path: str | Path) -> Judge:
    """The truth of the twin (.h5), of a virtual test (.json) or of the user's own mesh (.h5)."""
    if Path(path).suffix == ".json":
        return VirtualField.load(path)
    return MeshTruth.load(path) if is_mesh_truth(path) else Truth.load(str(path))


def check_truth(path: str | Path, states: int) -> None:
    """Before any work: ConfigError or MeshError where a truth cannot be read, or has not as many states
    as there are to judge."""
    truth = load_truth(path)
    if truth.states < states:
        raise ConfigError(
            f"truth {path} has {truth.states} states (at least {states}, those of scans.states); add "
            "their displacements, or leave out `truth`"
        )


def check_size(solid: np.ndarray, nodes: np.ndarray) -> None:
    """MeshError where the solid of the truth, by its points (n, 3), is over five times as large along
    every axis as the mesh of the struts, by its nodes (q, 3), or under a fifth: another unit."""
    sizes = np.ptp(solid, axis=0), np.ptp(nodes, axis=0)
    times = sizes[0] / np.maximum(sizes[1], 1e-12)
    if times.min() > LIKE or times.max() < 1 / LIKE:
        words = (" x ".join(f"{edge:.4g}" for edge in size) for size in sizes)
        raise MeshError(
            "the solid of the truth measures {}, the mesh of the struts {} voxels (up to five times as "
            "much or as little may be right): give its points, and displacements, in voxels of the "
            "binned and cropped reference".format(*words)
        )


def check_near(distance: np.ndarray) -> None:
    """MeshError where over half of the nodes are over AWAY voxels outside of the solid of the truth, by
    their `distance` (n,) to its surface; a warning where it is over FEW of them."""
    far = float(np.mean(distance > AWAY))
    if far > 0.5:
        raise MeshError(
            f"{far:.0%} of the nodes of the micro mesh are over {AWAY:g} voxels outside of the solid of "
            "the truth (at most half): its points are in voxels of the binned and cropped reference, "
            "x y z; check their unit, scans.crop and scans.bin"
        )
    if far > FEW:
        log.warning(
            "WARNING: %.0f %% of the nodes are over %g voxels outside of the solid of the truth, "
            "where it is extrapolated: errors there mean little", 100 * far, AWAY,
        )  # fmt: skip


def judged_nodes(cells: np.ndarray, penalised: np.ndarray, torn: Sequence[int]) -> np.ndarray:
    """Nodes (n,) bool of the micro mesh that all results of a state are judged at: in the bulk, not
    `penalised` (n,), and of no cell that micro DVC says is torn.

    The place of a break is known to a voxel, and the truth jumps there: in the solid twin at 15 % by
    9 voxels from one node to the next, where 2 of 48,212 nodes, on the wrong side, are a fifth of the
    mean square of the error normal to the struts."""
    judged = penalised == 0
    judged[cells[list(torn)]] = False
    return judged


def error_statistics(error: np.ndarray, tangent: np.ndarray | None) -> dict:
    """Lengths of error vectors (n, 3) in voxels: rms, median, 95th percentile, share below 1.

    With the tangents (n, 3) of the struts also the rms normal to and along the strut: a slip along
    a uniform strut cannot be seen in an image. MeshError where there is no node."""
    if len(error) == 0:
        raise MeshError(
            "no node of the micro mesh can be judged: all are at its ends; widen micro.region"
        )
    length = np.linalg.norm(error, axis=1)
    result = {
        "count": len(error),
        "rms": float(np.sqrt(np.mean(length**2))),
        "median": float(np.median(length)),
        "p95": float(np.percentile(length, 95)),
        "within_1_voxel": float(np.mean(length < 1)),
    }
    if tangent is None:
        return result | {"rms_normal": None, "rms_along": None}
    along = np.einsum("ni,ni->n", error, tangent)
    normal = np.sqrt(np.maximum(length**2 - along**2, 0))
    return result | {
        "rms_normal": float(np.sqrt(np.mean(normal**2))),
        "rms_along": float(np.sqrt(np.mean(along**2))),
    }


def junction_accuracy(
    junctions: np.ndarray, points: np.ndarray, error: np.ndarray
) -> dict[str, float | int | None]:
    """How many junctions (j, 3) have points (n, 3) within BODY voxels, and the shares of these whose
    mean error vector, of (n, 3), is below 1, 2 and 4 voxels; None where there is none."""
    tree = cKDTree(points)
    near = tree.query_ball_point(junctions, BODY) if len(junctions) else []
    off = np.array([np.linalg.norm(error[nodes].mean(axis=0)) for nodes in near if nodes])
    shares = {
        f"within_{limit}": float(np.mean(off < limit)) if len(off) else None for limit in (1, 2, 4)
    }
    return {"count": len(off)} | shares


def errors_at(
    truth: Judge, points: np.ndarray, fields: Iterable[np.ndarray], state: int
) -> list[dict]:
    """Error statistics of each u (n, 3) of `fields`, measured at points (n, 3) of the reference, with
    the accuracy of junctions where the truth has struts. Raises MeshError where the truth is not
    there."""
    true = truth.displacement(points, state)
    if isinstance(truth, VirtualField):
        return [error_statistics(u - true, None) for u in fields]
    if isinstance(truth, MeshTruth):
        check_size(truth.mesh.points, points)
    _, tangent, distance = truth.strut(points)
    check_near(distance)
    return [
        error_statistics(u - true, tangent)
        | {"junctions": junction_accuracy(truth.junctions, points, u - true)}
        for u in fields
    ]
