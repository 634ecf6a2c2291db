"""Fig. 13 and 15: residual, displacement and strain on the struts, meso beside micro."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from matplotlib.patches import Patch

from addvc.analysis.residuals import by_cell
from addvc.fem.mesh import outer_faces
from addvc.fem.operators import strain
from addvc.report import style
from addvc.report.case import Case
from addvc.report.scene import Layer, aspect, facing, oblique, render
from addvc.report.surfaces import clipped, slab, slab_box

STRAINS = {
    "small": r"strain $\|\varepsilon\|_F$ (–)",
    "green_lagrange": "Green-Lagrange strain\n" + r"$\|E\|_F$ (–)",
}


def residual_maps(case: Case, outputs: Iterable[str]) -> None:
    """Fig. 13: mean residual of each micro cell, a row a method, a column a state."""
    mesh, names = case.mesh("micro"), [case.finest, *case.micro]
    faces, owner = outer_faces(mesh)
    view = oblique(case.specimen.axis)
    values = {
        (name, n): _cell_residual(case, name, n, len(mesh.cells))[owner]
        for name in names
        for n in case.pictured
    }
    norm, columns = _residual_range(case, values), len(case.pictured)
    fig, axes = style.panels(len(names), columns, aspect(view, mesh.points), 15, 18, below=6)
    for panel, ((name, state), r) in enumerate(values.items()):
        layer = Layer(mesh.points, faces, values=r, norm=norm, cmap=style.SIGNED)
        render([layer], view, 150 / columns).show(axes.flat[panel])
        title = case.title(state, name).replace(", ", ",\n")
        style.headline(axes.flat[panel], title, panel)
    for ax, name in zip(axes[:, 0], names, strict=True):
        style.row_name(ax, name)
    style.scale_bar(axes[-1, 0], case.voxel_um, 0.4)
    style.axis_arrows(axes[-1, -1], view.right, view.up)
    label = "residual r (grey levels)"
    style.colour_bar(fig, axes, norm, style.SIGNED, label, shrink=0.7, aspect=30)
    style.save(fig, outputs)


def _residual_range(case: Case, values: dict) -> style.Normalize:
    """About zero, from the results that are right where there are any."""
    usable = [r for (name, state), r in values.items() if not case.status(name, state)]
    return style.robust_range(usable or list(values.values()), signed=True, share=1)


def _cell_residual(case: Case, name: str, state: int, cells: int) -> np.ndarray:
    """Weighted mean of r over the Gauss points of each micro cell (m,); 0 outside of the image."""
    r, weight, _ = case.residual(name, state)
    return np.nan_to_num(by_cell(r, weight, weight > 0, cells))


def fields(case: Case, outputs: Iterable[str], kind: str) -> None:
    """Fig. 15: u_x, u_y, u_z and the norm of the strain, of a `kind` of STRAINS, in a slice a cell
    thick; left the finest meso mesh, right micro DVC."""
    names, state = (case.finest, case.micro[0]), case.shown_state()
    slices = [_slice(case, name, state, kind == "green_lagrange") for name in names]
    labels = [f"$u_{x}$ ({style.voxels(case.voxel_um)})" for x in style.AXES]
    labels.append(STRAINS[kind])
    view = facing(case.specimen.axis, slab(case.mesh("micro"), case.specimen.axis, 1)[0])
    fig, axes = style.panels(4, 2, aspect(view, slices[0].points), 11, 18, below=8)
    for d, label in enumerate(labels):
        pair = [part.values[d] for part in slices]
        norm, cmap = _strain_range(pair) if d == 3 else style.component_range(pair)
        for column, (name, part) in enumerate(zip(names, slices, strict=True)):
            render(part.layers(d, norm, cmap), view, 75).show(axes[d, column])
            text = f"{name}, {case.title(state, name)}"
            style.headline(axes[d, column], text, 2 * d + column)
        style.colour_bar(fig, axes[d], norm, cmap, label, aspect=16, shrink=0.9, pad=0.02)
    style.scale_bar(axes[-1, 0], case.voxel_um)
    style.axis_arrows(axes[-1, 1], view.right, view.up)
    if any(part.doubtful.any() for part in slices):
        doubt = [Patch(color=style.DOUBT, label="in doubt: residual far above the noise")]
        fig.legend(handles=doubt, loc="outside lower center")
    style.save(fig, outputs)


@dataclass(frozen=True, eq=False)
class Slice:
    """Triangles (f, 3) between points (p, 3); u_x, u_y, u_z (p,) and the strain norm (f,) as `values`;
    `doubtful` (f,) where a corner of them is not valid."""

    points: np.ndarray
    faces: np.ndarray
    values: list[np.ndarray]
    doubtful: np.ndarray

    def layers(self, number: int, norm: style.Normalize, cmap: str) -> list[Layer]:
        """Triangles in the colours of one of the values, doubtful ones in theirs."""
        values, right = self.values[number], ~self.doubtful
        values = values[right] if len(values) == len(right) else values
        found = [Layer(self.points, self.faces[right], values=values, norm=norm, cmap=cmap)]
        return [*found, Layer(self.points, self.faces[self.doubtful], style.DOUBT)]


def _slice(case: Case, name: str, state: int, finite: bool) -> Slice:
    """The slice of Fig. 14, with the small strain or that of Green and Lagrange (`finite`)."""
    mesh, u = case.mesh("micro"), case.displacement(name, state)
    low, high = slab_box(mesh, case.specimen.axis, case.cell_size)
    norm = np.linalg.norm(strain(mesh, u, finite), axis=(1, 2))
    valid = case.valid(name, state) if name in case.micro else np.ones(len(u))
    points, faces, found = clipped(mesh, low, high, u=u, strain=norm, valid=valid.astype(float))
    doubtful = (found["valid"][faces] < 0.5).any(axis=1)
    return Slice(points, faces, [*found["u"].T, found["strain"]], doubtful)


def _strain_range(pair: list[np.ndarray]) -> tuple[style.Normalize, str]:
    """From zero to what all but 2 % of either stay below, with more colours for small strains."""
    top = max(float(np.percentile(values, 98)) for values in pair)
    return style.root_range(0.0, max(top, 1e-3)), style.MAGNITUDE
