"""Fig. 10 and 11: what meso DVC finds, on its own meshes."""

from collections.abc import Iterable

import numpy as np

from addvc.fem.mesh import Mesh
from addvc.report import style
from addvc.report.case import Case
from addvc.report.scene import Layer, oblique, render
from addvc.report.surfaces import boundary, box_corners, centroids

GOOD, BAD = "#a9c8e6", "#eab0a4"


def deformed(case: Case, outputs: Iterable[str]) -> None:
    """Fig. 10: each meso mesh deformed by its displacement, a row a mesh, with sigma(r)."""
    columns, rows = len(case.states), len(case.meso)
    fig = style.figure(8 + rows * min(62, 185 / columns))
    axes = fig.subplots(rows, columns, squeeze=False)
    meshes = [case.mesh(name) for name in case.meso]
    fit = _reach(meshes[-1])
    for row, (name, mesh) in enumerate(zip(case.meso, meshes, strict=True)):
        for column, state in enumerate(case.states):
            solution = case.solution(name, state)
            colour = GOOD if solution.converged else BAD
            faces, _ = boundary(mesh)
            layer = Layer(mesh.points + solution.u, faces, colour, edges=True, line_width=1.5)
            ax = axes[row, column]
            render([layer], oblique(case.specimen.axis), 170 / columns, fit).show(ax)
            style.headline(ax, case.title(state, name), row * columns + column)
            ax.text(0.5, 0, f"σ(r) = {solution.residual['std']:.2f}", transform=ax.transAxes,
                    ha="center", va="top")  # fmt: skip
            if column == 0:
                ax.text(-0.02, 0.5, name, transform=ax.transAxes, rotation=90, ha="right",
                        va="center", fontsize=9)  # fmt: skip
    style.save(fig, outputs)


def _reach(mesh: Mesh) -> np.ndarray:
    """Corners of a box a little wider than a mesh: room for the bulge of compression."""
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    room = 0.05 * (high - low)
    return box_corners(low - room, high + room)


def displacement(case: Case, outputs: Iterable[str]) -> None:
    """Fig. 11: u_x, u_y, u_z of the finest meso mesh, cut in half, a column a state."""
    mesh, axis = case.mesh(case.finest), case.specimen.axis
    view = oblique(axis, azimuth=20, elevation=18)
    level = view.towards - view.towards[axis] * np.eye(3)[axis]
    behind = (centroids(mesh) - mesh.points.mean(axis=0)) @ level < 0
    faces, _ = boundary(mesh, behind)
    u = {state: case.solution(case.finest, state).u for state in case.states}
    usable = [n for n in case.states if case.converged(case.finest, n)] or case.states
    fig = style.figure(14 + 3 * min(58, 165 / len(u)))
    axes = fig.subplots(3, len(u), squeeze=False)
    for d in range(3):
        norm, cmap = style.component_range([u[n][:, d] for n in usable])
        for column, state in enumerate(case.states):
            ax, values = axes[d, column], u[state][:, d]
            layer = Layer(mesh.points + u[state], faces, values=values, norm=norm, cmap=cmap)
            render([layer], view, 150 / len(u), _reach(mesh)).show(ax)
            style.headline(ax, case.title(state, case.finest), d * len(u) + column)
            ax.text(0.5, 0, f"{values.min():.2f} to {values.max():.2f}", ha="center", va="top",
                    transform=ax.transAxes, fontsize=8)  # fmt: skip
        label = f"$u_{style.AXES[d]}$ ({style.voxels(case.voxel_um())})"
        style.colour_bar(fig, axes[d], norm, cmap, label, shrink=0.85, aspect=18, pad=0.01)
    style.save(fig, outputs)
