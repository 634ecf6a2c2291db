"""Fig. 10 and 11: what meso DVC finds, on its own meshes."""

from collections.abc import Iterable

import numpy as np

from addvc.errors import grey_words
from addvc.fem.mesh import Mesh, outer_faces
from addvc.report import style
from addvc.report.case import Case
from addvc.report.scene import Layer, aspect, oblique, render
from addvc.report.surfaces import box_corners, clipped

GOOD, BAD = "#a9c8e6", "#eab0a4"


def deformed(case: Case, outputs: Iterable[str]) -> None:
    """Fig. 10: each meso mesh deformed by its displacement, a row a mesh, with sigma(r)."""
    columns, rows = len(case.pictured), len(case.meso)
    meshes = [case.mesh(name) for name in case.meso]
    fit, view = _reach(meshes[-1]), oblique(case.specimen.axis)
    fig, axes = style.panels(rows, columns, aspect(view, fit), spare=15, below=9)
    for row, (name, mesh) in enumerate(zip(case.meso, meshes, strict=True)):
        faces, _ = outer_faces(mesh)
        for column, state in enumerate(case.pictured):
            solution, ax = case.solution(name, state), axes[row, column]
            colour = BAD if case.status(name, state) else GOOD
            layer = Layer(mesh.points + solution.u, faces, colour, edges=True, line_width=1.5)
            render([layer], view, 170 / columns, fit).show(ax)
            style.headline(ax, case.title(state, name), row * columns + column)
            sigma = f"σ(r) = {grey_words(solution.residual['std'])} grey levels"
            style.note(ax, sigma, fontsize=8)
        style.row_name(axes[row, 0], name)
    style.scale_bar(axes[-1, 0], case.voxel_um, 0.4, y=-0.2)
    style.axis_arrows(axes[-1, -1], view.right, view.up, y=-0.28)
    style.save(fig, outputs)


def _reach(mesh: Mesh) -> np.ndarray:
    """Corners of a box a little wider than a mesh: room for the bulge of compression."""
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    room = 0.05 * (high - low)
    return box_corners(low - room, high + room)


def displacement(case: Case, outputs: Iterable[str]) -> None:
    """Fig. 11: u_x, u_y, u_z of the finest meso mesh, cut in half, a column a state."""
    mesh, axis, name = case.mesh(case.finest), case.specimen.axis, case.finest
    view, fit = oblique(axis, azimuth=20, elevation=18), _reach(mesh)
    u = {n: case.solution(name, n).u for n in case.pictured}
    halves = {n: _half(mesh, u[n], axis) for n in u}
    usable = [n for n in u if not case.status(name, n)] or list(u)
    columns = len(u)
    fig, axes = style.panels(3, columns, aspect(view, fit), bar=16, below=8)
    for d in range(3):
        norm, cmap = style.component_range([u[n][:, d] for n in usable], root=True)
        for column, state in enumerate(u):
            points, faces, motion = halves[state]
            layer = Layer(points + motion, faces, values=motion[:, d], norm=norm, cmap=cmap)
            ax, values = axes[d, column], u[state][:, d]
            render([layer], view, 150 / columns, fit).show(ax)
            style.headline(ax, case.title(state, name), d * columns + column)
            text = f"{style.signed(values.min())} to {style.signed(values.max())} voxels"
            style.note(ax, text, fontsize=8)
        label = f"$u_{style.AXES[d]}$ ({style.voxels(case.voxel_um)})"
        style.colour_bar(fig, axes[d], norm, cmap, label, shrink=0.85, aspect=18, pad=0.01)
    style.scale_bar(axes[-1, 0], case.voxel_um, 0.4, y=-0.17)
    style.axis_arrows(axes[-1, -1], view.right, view.up, y=-0.17)
    style.save(fig, outputs)


def _half(mesh: Mesh, u: np.ndarray, axis: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points, triangles and u (n, 3) of the half of a mesh behind its middle, seen by `oblique`."""
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    toward = (axis + 1) % 3
    high[toward] = (low[toward] + high[toward]) / 2
    points, faces, found = clipped(mesh, low, high, u=u)
    return points, faces, found["u"]
