"""Fig. 16 and 17: the reference carried by the measured displacement onto the deformed image."""

from collections.abc import Iterable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Patch
from scipy.spatial import cKDTree

from addvc.fem.mesh import Mesh, outer_faces
from addvc.geometry.region import Region, caps_depth
from addvc.report import style
from addvc.report.case import Case
from addvc.report.scene import Layer, Picture, View, aspect, facing, render
from addvc.report.surfaces import clipped, segmented, slab, slab_box

MESO, MICRO = "#e0903c", "#3d86cf"


def warped(case: Case, outputs: Iterable[str]) -> None:
    """Fig. 16: slices of (a) I_r, (b) I_d, and of the micro mesh carried by (c) meso, (d) micro."""
    mesh, axis, state = case.mesh("micro"), case.specimen.axis, case.shown_state()
    u = {name: case.displacement(name, state) for name in (case.finest, case.micro[0])}
    before = slab_box(mesh, axis, case.cell_size)
    after = _carried_box(mesh, u[case.micro[0]], before, axis)
    images = (0, before), (state, after)
    surfaces = [segmented(case.image(n), case.gamma, *box) for n, box in images]
    titles = "segmented $I_r$", f"segmented $I_d$, {case.labels[state]}"
    bodies = dict(zip(titles, surfaces, strict=True))
    for name in u:
        title = f"$I_r$ carried by {name}: {case.verdict(name, state)}"
        bodies[title] = _cut(mesh, u[name], *after)
    found = case.json(f"analysis/warp_state{state}.json")
    words = [f"line: outline of (b)\n{_words(found[name])}" for name in u]
    _draw_warped(bodies, words, facing(axis, slab(mesh, axis, 1)[0]), case.voxel_um, outputs)


def _draw_warped(bodies: dict, words: list, view: View, voxel_um: float, outputs) -> None:
    """The four surfaces of Fig. 16 at one scale, the outline of (b) over the carried ones, and `words`
    below these."""
    titles, surfaces = list(bodies), list(bodies.values())
    fits = [_row_fit(surfaces, surfaces[:2], view), _row_fit(surfaces, surfaces[2:], view)]
    fig, axes = style.rows_of_pictures([aspect(view, fit) for fit in fits], 2, spare=20)
    colours = style.SOLID, style.SOLID, MESO, MICRO
    for panel, (ax, title, body) in enumerate(zip(axes.flat, titles, surfaces, strict=True)):
        fit = fits[panel // 2]
        render([Layer(*body, colours[panel])], view, 82, fit, shadows=True).show(ax)
        style.headline(ax, title, panel)
        if panel > 1:
            _outline(ax, render([Layer(*surfaces[1], "#000000")], view, 82, fit))
            style.note(ax, words[panel - 2], y=-0.02)
    style.scale_bar(axes[0, 0], voxel_um, 0.2)
    style.axis_arrows(axes[0, 1], view.right, view.up)
    style.save(fig, outputs)


def _row_fit(everything: list, row: list, view: View) -> np.ndarray:
    """Two corners (2, 3) of a picture: as wide as all surfaces, as high as those of its row."""
    across = np.concatenate([points @ view.right for points, _ in everything])
    along = np.concatenate([points @ view.up for points, _ in row])
    ends = [(across.min(), along.min()), (across.max(), along.max())]
    return np.array([x * view.right + y * view.up for x, y in ends])


def _outline(ax: Axes, picture: Picture) -> None:
    """The edge of what a picture shows on white, as a line."""
    solid = (picture.image.min(axis=2) < 128).astype(float)
    options = {"extent": picture.extent, "origin": "upper"}
    ax.contour(solid, [0.5], colors=style.DARK, linewidths=0.5, **options)


def _words(found: dict) -> str:
    """How well the whole mesh is carried, not the slice alone."""
    figures = (found["dice"], found["distance_median"], found["distance_p95"])
    overlap, middle, far = ("–" if x is None else f"{x:.2f}" for x in figures)
    return f"whole mesh: overlap {overlap}\ndistance {middle}, p95 {far} voxels"


def _carried_box(mesh: Mesh, u: np.ndarray, box: tuple, axis: int) -> tuple[np.ndarray, np.ndarray]:
    """The box of a slice after the motion of its nodes: its ends follow the ends of the mesh, its
    faces the median; across it holds whatever has moved out."""
    low, high = (corner.copy() for corner in box)
    normal = slab(mesh, axis, 1)[0]
    other = 3 - axis - normal
    inside = (mesh.points[:, normal] >= low[normal]) & (mesh.points[:, normal] <= high[normal])
    low[other], high[other] = np.percentile((mesh.points + u)[inside, other], (0.2, 99.8))
    reach = 0.05 * np.ptp(mesh.points[:, axis]) + 1
    for corner in (low, high):
        near = np.abs(mesh.points[:, axis] - corner[axis]) < reach
        corner[axis] += np.median(u[near, axis])
        corner[normal] += np.median(u[inside, normal])
    return low, high


def _cut(mesh: Mesh, u: np.ndarray, low, high) -> tuple[np.ndarray, np.ndarray]:
    """Surface of the mesh carried by u, inside a box."""
    return clipped(Mesh(mesh.points + u, mesh.cells), low, high)[:2]


def zoom(case: Case, outputs: Iterable[str]) -> None:
    """Fig. 17: two places where meso and micro differ most: I_r, then either carried onto I_d."""
    mesh, state = case.mesh("micro"), case.shown_state()
    meso, micro = (case.displacement(name, state) for name in (case.finest, case.micro[0]))
    half = 0.45 * case.cell_size
    places = _places(case, mesh, np.linalg.norm(micro - meso, axis=1), half)
    deformed, gamma = case.image(state), case.gamma
    titles = [
        "struts of $I_r$",
        *(_zoom_title(case, n, state) for n in (case.finest, case.micro[0])),
    ]
    fig, axes = style.panels(len(places), 3, 1.0, below=6)
    for row, node in enumerate(places):
        view = _across(micro[node] - meso[node], case.specimen.axis)
        here, there = mesh.points[node], mesh.points[node] + micro[node]
        box = there - half, there + half
        image = Layer(*segmented(deformed, gamma, *box), style.SOLID, opacity=0.6, smooth=True)
        carried = [[image, Layer(*_cut(mesh, u, *box), style.RED)] for u in (meso, micro)]
        still = [Layer(*_cut(mesh, np.zeros_like(micro), here - half, here + half))]
        for column, layers in enumerate((still, *carried)):
            centre = there if column else here
            fit = centre + half * np.vstack([view.right + view.up, -view.right - view.up])
            render(layers, view, 55, fit).show(axes[row, column])
            style.headline(axes[row, column], titles[column], 3 * row + column)
        style.scale_bar(axes[row, 0], case.voxel_um)
        style.axis_arrows(axes[row, -1], view.right, view.up, y=-0.08)
    label = case.labels[state]
    colours = {
        f"segmented $I_d$, {label} (pink over a carried strut)": style.SOLID,
        "struts of $I_r$, carried": style.RED,
    }
    handles = [Patch(color=colour, label=label) for label, colour in colours.items()]
    fig.legend(handles=handles, loc="outside lower center", ncols=2)
    style.save(fig, outputs)


def _zoom_title(case: Case, name: str, state: int) -> str:
    return f"carried by {name}: {case.verdict(name, state)}"


def _places(case: Case, mesh: Mesh, gap: np.ndarray, half: float, count: int = 2) -> list[int]:
    """Nodes where the gap, averaged over its surroundings, is largest, 3 `half` apart: inside the
    region, among at least as many struts as is usual."""
    nodes = np.unique(outer_faces(mesh)[0])[::4]
    tree = cKDTree(mesh.points)
    close = tree.query_ball_point(mesh.points[nodes], half / 3)
    around = np.array([gap[near].mean() for near in close])
    depth = np.min(caps_depth(Region(**case.json("geometry/region.json")), mesh.points[nodes]), 0)
    crowd = tree.query_ball_point(mesh.points[nodes], half, return_length=True)
    around[(depth < half) | (crowd < np.median(crowd))] -= 1e6
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
