"""Fig. 16 and 17: the reference carried by the measured displacement onto the deformed image."""

from collections.abc import Iterable

import numpy as np
from scipy.spatial import cKDTree

from addvc.fem.mesh import Mesh
from addvc.report import style
from addvc.report.case import Case
from addvc.report.scene import Layer, Picture, View, facing, render
from addvc.report.surfaces import boundary, box_corners, centroids, compact, in_box, segmented, slab

MESO, MICRO = "#e0903c", "#3d86cf"


def warped(case: Case, outputs: Iterable[str], state: int) -> None:
    """Fig. 16: slices of (a) I_r, (b) I_d, and of the micro mesh carried by (c) meso, (d) micro."""
    mesh, axis = case.mesh("micro"), case.specimen.axis
    u = {name: case.displacement(name, state) for name in (case.finest, "micro")}
    low, high = _slice_box(mesh, axis, case.cell_size)
    end = [corner + _mean_motion(mesh, u["micro"], corner, axis) for corner in (low, high)]
    image = segmented(case.image(state)[0], case.gamma, *end)
    bodies = [segmented(case.image(0)[0], case.gamma, low, high), image,
              *(_cut(mesh, u[name], *end) for name in u)]  # fmt: skip
    titles = ["segmented $I_r$", f"segmented $I_d$, {case.labels[state]}",
              *(f"$I_r$ carried by {name}" + _failure(case, name, state) for name in u)]  # fmt: skip
    colours = (style.SOLID, style.SOLID, MESO, MICRO)
    view = facing(axis, slab(mesh, axis, 1)[0])
    fit = np.vstack([box_corners(low, high), box_corners(*end)])
    fig = style.figure(_height(view, fit, rows=2))
    axes = fig.subplots(2, 2).ravel()
    for panel, (ax, body) in enumerate(zip(axes, bodies, strict=True)):
        render([Layer(*body, colours[panel])], view, 82, fit, shadows=True).show(ax)
        style.headline(ax, titles[panel], panel)
        if panel > 1:
            gap = _gap(body[0], image)
            ax.text(1, -0.025, f"distance to $I_d$: median {np.median(gap):.2f}, p95 "
                    f"{np.percentile(gap, 95):.2f} voxels", transform=ax.transAxes, ha="right",
                    va="top", fontsize=8)  # fmt: skip
    style.scale_bar(axes[2], case.voxel_um(), 0.2)
    style.save(fig, outputs)


def _failure(case: Case, name: str, state: int) -> str:
    return "" if case.converged(name, state) else " (failed)"


def _height(view: View, fit: np.ndarray, rows: int) -> float:
    """Height of a figure with two columns of pictures of `fit`, millimetres."""
    width, height = np.ptp(view.project(fit), axis=0)
    return rows * (14 + 82 * min(height / width, 1.25))


def _slice_box(mesh: Mesh, axis: int, thickness: float) -> tuple[np.ndarray, np.ndarray]:
    """Corners of the slice of Fig. 14."""
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    normal, low[normal], high[normal] = slab(mesh, axis, thickness)
    return low, high


def _mean_motion(mesh: Mesh, u: np.ndarray, corner: np.ndarray, axis: int) -> np.ndarray:
    """Median displacement near the end of the mesh that a corner of its box lies on."""
    reach = 0.05 * np.ptp(mesh.points[:, axis]) + 1
    near = np.abs(mesh.points[:, axis] - corner[axis]) < reach
    middle = np.median(u, axis=0)
    middle[axis] = np.median(u[near, axis])
    return middle


def _cut(mesh: Mesh, u: np.ndarray, low, high) -> tuple[np.ndarray, np.ndarray]:
    """Surface of the mesh carried by u, of the cells that end up in a box."""
    faces, _ = boundary(mesh, in_box(centroids(mesh, u), low, high))
    points, faces, _ = compact(mesh.points + u, faces)
    return points, faces


def _gap(points: np.ndarray, image: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """Distance (n,) of points to the triangles of a segmented image, by their middles, voxels."""
    surface, faces = image
    if len(faces) == 0:
        return np.full(len(points), np.nan)
    corner = surface[faces]
    samples = np.vstack([surface, corner.mean(axis=1),
                         *((corner[:, i] + corner[:, (i + 1) % 3]) / 2 for i in range(3))])  # fmt: skip
    return cKDTree(samples).query(points)[0]


def zoom(case: Case, outputs: Iterable[str], state: int) -> None:
    """Fig. 17: two places where meso and micro differ most; reference, meso on I_d, micro on I_d."""
    mesh = case.mesh("micro")
    u = {name: case.displacement(name, state) for name in (case.finest, "micro")}
    half = 0.45 * case.cell_size
    places = _places(mesh, np.linalg.norm(u["micro"] - u[case.finest], axis=1), half)
    deformed, gamma = case.image(state)[0], case.gamma
    fig = style.figure(62 * len(places))
    axes = fig.subplots(len(places), 3, squeeze=False)
    for row, node in enumerate(places):
        view = _across(u["micro"][node] - u[case.finest][node], case.specimen.axis)
        for column, name in enumerate((None, *u)):
            ax, panel = axes[row, column], 3 * row + column
            _zoom(mesh, u, name, node, half, deformed, gamma, view).show(ax)
            style.headline(ax, _zoom_title(case, name, state), panel)
        style.scale_bar(axes[row, 0], case.voxel_um())
    style.save(fig, outputs)


def _zoom_title(case: Case, name: str | None, state: int) -> str:
    if name is None:
        return r"$\Omega_r$"
    return rf"$\Omega_d$ and $\Omega_r + u$, {name}{_failure(case, name, state)}"


def _zoom(mesh: Mesh, u: dict, name: str | None, node: int, half: float, deformed, gamma: float,
          view: View) -> Picture:  # fmt: skip
    """One panel: the reference, or in grey I_d with the carried reference in red."""
    centre = mesh.points[node] + (0 if name is None else u["micro"][node])
    box = centre - half, centre + half
    fit = centre + half * np.vstack([view.right + view.up, -view.right - view.up])
    if name is None:
        return render([Layer(*_cut(mesh, np.zeros_like(mesh.points), *box))], view, 55, fit, True)
    layers = [Layer(*segmented(deformed, gamma, *box), style.SOLID, opacity=0.55),
              Layer(*_cut(mesh, u[name], *box), style.RED)]  # fmt: skip
    return render(layers, view, 55, fit)


def _places(mesh: Mesh, gap: np.ndarray, half: float, count: int = 2) -> list[int]:
    """Nodes where the gap, averaged over its surroundings, is largest; 3 `half` apart and away from
    the ends of the mesh."""
    nodes = np.unique(boundary(mesh)[0])[::4]
    tree = cKDTree(mesh.points)
    around = np.array([gap[near].mean() for near in tree.query_ball_point(mesh.points[nodes], half / 4)])  # fmt: skip
    low, high = mesh.points.min(axis=0) + half, mesh.points.max(axis=0) - half
    inner = in_box(mesh.points[nodes], low, high)
    around = np.where(inner if inner.any() else True, around, -1)
    chosen: list[int] = []
    for place in np.argsort(-around):
        away = np.linalg.norm(mesh.points[chosen] - mesh.points[nodes[place]], axis=1)
        if (away > 3 * half).all():
            chosen.append(int(nodes[place]))
        if len(chosen) == count:
            break
    return chosen


def _across(gap: np.ndarray, axis: int) -> View:
    """A view in which a difference of displacements lies in the picture, the loading axis up."""
    up = np.eye(3)[axis]
    level = gap - gap[axis] * up
    right = level / np.linalg.norm(level) if np.linalg.norm(level) > 1e-6 else np.roll(up, 1)
    return View(right, up, np.cross(right, up))
