"""Slices of images, with their axes in voxels; Fig. 6: the platen grid over one."""

from collections.abc import Iterable

import numpy as np
from matplotlib.axes import Axes

from addvc.fem.mesh import outer_faces
from addvc.images.specimen import Specimen
from addvc.report import style
from addvc.report.case import Case
from addvc.report.scene import Layer, oblique, render
from addvc.report.surfaces import whole_foam


def show_slice(ax: Axes, plane: np.ndarray, limits: tuple[float, float]) -> None:
    """Grey levels (columns, rows) of a plane, the first index to the right, the second up."""
    columns, rows = plane.shape
    ax.imshow(
        plane.T,
        cmap="gray",
        origin="lower",
        vmin=limits[0],
        vmax=limits[1],
        extent=(-0.5, columns - 0.5, -0.5, rows - 0.5),
    )
    ax.set_aspect("equal")


def slab_across(ax: Axes, volume: np.ndarray, specimen: Specimen, thickness: int) -> None:
    """The brightest voxels of a slab across the loading axis in the middle of the specimen."""
    first = max(round((specimen.low + specimen.high - thickness) / 2), 0)
    slab = np.moveaxis(volume, specimen.axis, 0)[first : first + thickness]
    plane = slab.max(axis=0)
    show_slice(ax, plane, tuple(np.percentile(plane, (0.5, 99.8))))
    ax.set_axis_off()


def platen_grid(case: Case, outputs: Iterable[str]) -> None:
    """Fig. 6: (a) the hexahedral grid over a slice that holds both platens, (b) in space."""
    volume = case.image(0)
    specimen, grid = case.specimen, case.mesh("grid")
    points, faces = whole_foam(volume, case.gamma, specimen, specimen.low, specimen.high)
    edges = _edges(outer_faces(grid)[0])
    layers = [Layer(points, faces), Layer(grid.points, edges, style.BLUE, line_width=5)]
    view = oblique(specimen.axis)
    picture = render(layers, view, 80, shadows=True)
    slice_aspect = volume.shape[specimen.axis] / volume.shape[specimen.across[1]]
    fig, axes = style.panels(1, 2, max(picture.aspect, slice_aspect), spare=15)
    left, right = axes[0]
    picture.show(right)
    _grid_over_slice(left, volume, specimen, grid.points)
    style.scale_bar(left, case.voxel_um)
    style.axis_arrows(left, *np.eye(3)[[specimen.across[1], specimen.axis]])
    style.axis_arrows(right, view.right, view.up)
    style.headline(left, "grid over the middle slice", 0)
    cells = f"{len(grid.cells)} hexahedra, {len(grid.points)} nodes"
    style.headline(right, cells, 1)
    style.save(fig, outputs)


def _grid_over_slice(ax: Axes, volume: np.ndarray, specimen: Specimen, nodes: np.ndarray) -> None:
    """Grid lines and platen faces over the plane across the first axis that is not loaded."""
    normal, other = specimen.across
    plane = np.take(volume, volume.shape[normal] // 2, axis=normal)
    plane = plane if other < specimen.axis else plane.T  # (other, loading axis)
    show_slice(ax, plane, tuple(np.percentile(plane, (0.5, 99.9))))
    across, along = np.unique(nodes[:, other]), np.unique(nodes[:, specimen.axis])
    ax.vlines(across, along[0], along[-1], color="#5aa9ff", lw=1.2)
    ax.hlines(along, across[0], across[-1], color="#5aa9ff", lw=1.2)
    for face, shift, side in ((specimen.low, -2, "top"), (specimen.high, 2, "bottom")):
        if not 0 < face < plane.shape[1] - 1:
            continue  # no platen in the image at this end
        ax.axhline(face, color=style.ORANGE, lw=1.2, ls="--")
        words = {"color": style.ORANGE, "fontsize": 8, "fontweight": "bold"}
        ax.text(0.02 * plane.shape[0], face + shift, "platen", va=side, **words)
    ax.set_axis_off()


def _edges(faces: np.ndarray) -> np.ndarray:
    """Distinct edges (e, 2) of faces (f, 4)."""
    pairs = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2)
    return np.unique(np.sort(pairs, axis=1), axis=0)
