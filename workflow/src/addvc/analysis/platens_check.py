"""The platens as the images show them, beside the ends of what was measured between them.

A face is known to some hundredths of a voxel without any registration (`images.platens`). On the
default twin, a second one and the solid twin the median displacement of the ends of the finest meso
mesh differs from its motion by .01 to .09 voxel, at 3.4 to 28.5 %.
"""

import numpy as np

from addvc.images.platens import both_faces

WIDER = 0.003
"""By which share the gap may grow from state to state."""

NEAR = 1.5
"""Voxels from a face within which nodes are at it."""


def platen_faces(reference: np.ndarray, deformed: np.ndarray, axis: int) -> dict | None:
    """Coordinates of both faces along the axis, `before` in the reference and `now` in a state, images
    (nx, ny, nz): two each, voxels; None where these do not both show both platens."""
    faces = both_faces(reference, deformed, axis)
    return None if faces is None else {"before": list(faces[0]), "now": list(faces[1])}


def opened(faces: dict[int, dict | None]) -> str:
    """Where the gap between the platens is wider in a state than in the one before: what to check, ""
    where it is in none. `faces`: of `platen_faces`, by state, in their order."""
    last, before = "the reference", None
    for state, one in faces.items():
        if one is None:
            continue
        before = np.ptp(one["before"]) if before is None else before
        now = np.ptp(one["now"])
        if now > (1 + WIDER) * before:
            return (
                f"the platens are {now:.1f} voxels apart in state {state}, in {last} {before:.1f} (at "
                f"most {1 + WIDER:g} times that under a growing load): unless the specimen was unloaded "
                "or pulled, scans.states is not in the order of loading, or scans.reference not the "
                "scan at rest"
            )
        last, before = f"state {state}", now
    return ""


def beside(faces: dict | None, along: np.ndarray, u: np.ndarray) -> dict | None:
    """What the platens did, and nodes at coordinates `along` (n,) of the axis whose displacement is
    u (n,), voxels: the `strain` of the gap, by how much either face `moved` and the nodes at the
    `ends`, and what these are `apart` at most. None without faces, or where none has a node."""
    if faces is None:
        return None
    before, now = np.array(faces["before"]), np.array(faces["now"])
    at = [np.abs(along - face) < NEAR for face in before]
    if not all(nodes.any() for nodes in at):
        return None
    moved, ends = now - before, np.array([np.median(u[nodes]) for nodes in at])
    return {
        "strain": float(1 - np.ptp(now) / np.ptp(before)),
        "moved": moved.tolist(),
        "ends": ends.tolist(),
        "apart": float(np.abs(ends - moved).max()),
    }
