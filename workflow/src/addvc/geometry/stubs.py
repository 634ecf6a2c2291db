"""Dangling stubs: struts that the threshold broke at mid-span, found by the skeleton, and cut off."""

import numpy as np
from scipy.spatial import cKDTree

from addvc.fem.mesh import Mesh, submesh
from addvc.geometry.lines import nearest_line, resampled
from addvc.geometry.skeleton import FREE_END, Branch, StrutGraph
from addvc.geometry.tets import largest_piece


def dangling_stubs(graph: StrutGraph, mesh: Mesh, cut: np.ndarray) -> list[dict]:
    """Branches that end in the bulk of the mesh, the longest first: position of the end, length beyond
    the ball of its junction, distance to the nearest other one (None for a single one); voxels.

    cut (n,) bool: nodes on platens, cuts and outer sides. An end counts when it is two strut diameters
    away from those, a diameter beyond its junction, and within a radius of a node of the mesh."""
    ends = [free_end(graph.branches[number], graph) for number in stub_branches(graph, mesh, cut)]
    found = [{"position": tip.tolist(), "length": length} for tip, length in ends]
    tips = np.array([stub["position"] for stub in found]).reshape(-1, 3)
    for stub, gap in zip(found, nearest_other(tips), strict=True):
        stub["nearest"] = gap
    return sorted(found, key=lambda stub: -stub["length"])


def nearest_other(points: np.ndarray) -> list[float | None]:
    """Distance of each point (n, 3) to the nearest other one, None where there is none."""
    if len(points) < 2:
        return [None] * len(points)
    return cKDTree(points).query(points, k=2)[0][:, 1].tolist()


def stub_branches(graph: StrutGraph, mesh: Mesh, cut: np.ndarray) -> list[int]:
    """Numbers of the branches of `dangling_stubs`."""
    if not graph.branches:
        return []
    radius = float(np.median(graph.radii))
    nodes = cKDTree(mesh.points)
    border = cKDTree(mesh.points[cut]) if cut.any() else None
    found = []
    for number, branch in enumerate(graph.branches):
        if branch.ends.count(FREE_END) != 1:
            continue
        tip, length = free_end(branch, graph)
        bulk = border is None or border.query(tip)[0] > 4 * radius
        if bulk and length > 2 * radius and nodes.query(tip)[0] <= radius:
            found.append(number)
    return found


def pruned(mesh: Mesh, graph: StrutGraph, cut: np.ndarray) -> tuple[Mesh, int]:
    """The mesh less its dangling stubs, in one piece, and how many they were.

    Of a stub goes what is nearer to its line than to any other, beyond the ball of its junction."""
    stubs = stub_branches(graph, mesh, cut)
    if not stubs:
        return mesh, 0
    centre = mesh.points[mesh.cells].mean(axis=1)
    owned = nearest_line([resampled(branch.points) for branch in graph.branches], centre)
    keep = np.ones(len(mesh.cells), dtype=bool)
    for number in stubs:
        junction = max(graph.branches[number].ends)  # the other is FREE_END
        away = np.linalg.norm(centre[owned[number]] - graph.junctions[junction], axis=1)
        keep[owned[number][away > graph.radii[junction]]] = False
    return largest_piece(submesh(mesh, keep))[0], len(stubs)


def free_end(branch: Branch, graph: StrutGraph) -> tuple[np.ndarray, float]:
    """Where a branch with one free end ends (3,), and its length beyond the ball of its junction."""
    last = 0 if branch.ends[0] == FREE_END else -1
    junction = branch.ends[0] if last else branch.ends[1]
    return branch.points[last], branch.length - float(graph.radii[junction])
