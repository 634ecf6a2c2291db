"""Beyond the paper, of a synthetic test: its scans, its network of beams, its mechanics."""

import csv
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, Normalize

from addvc.fem.io import read_vtu
from addvc.report import style
from addvc.report.case import Case
from addvc.report.scene import Layer, aspect, oblique, render
from addvc.report.slices import show_slice

ENERGIES = ("bending", "stretching", "shear", "torsion")
SPAN = 30.0  # energies are shown from their mean over this to their mean times this


def scans(case: Case, outputs: Iterable[str]) -> None:
    """Each scan as it is: (top) a slice along the loading axis, (bottom) its maximum projection."""
    numbers, specimen = [0, *case.pictured], case.specimen
    normal = specimen.across[1]
    images = [case.image(n, smooth=False) for n in numbers]
    pictures = [_upright(v, specimen.axis, normal) for v in images]
    nx, ny = pictures[0][0].shape
    fig, axes = style.panels(2, len(numbers), ny / nx, spare=7, bar=14)
    limits = tuple(np.percentile(images[0], (0.5, 99.9)))
    for column, (state, pair) in enumerate(zip(numbers, pictures, strict=True)):
        for ax, plane in zip(axes[:, column], pair, strict=True):
            show_slice(ax, plane, limits)
            ax.set_axis_off()
        style.headline(axes[0, column], case.labels[state] if state else "reference", column)
    style.row_name(axes[0, 0], "slice")
    style.row_name(axes[1, 0], "maximum projection")
    style.scale_bar(axes[1, 0], case.voxel_um, 0.5)
    style.colour_bar(fig, axes, Normalize(*limits), "gray", "grey level", shrink=0.6)
    style.save(fig, outputs)


def _upright(volume: np.ndarray, axis: int, normal: int) -> tuple[np.ndarray, np.ndarray]:
    """Middle slice and maximum projection across `normal`, the loading axis second.

    The projection is of the middle third, where struts can be told apart."""
    n = volume.shape[normal]
    planes = (
        np.take(volume, n // 2, axis=normal),
        np.take(volume, range(n // 3, 2 * n // 3), axis=normal).max(axis=normal),
    )
    return planes if axis > 3 - axis - normal else tuple(plane.T for plane in planes)


def network(case: Case, outputs: Iterable[str], files: list[str]) -> None:
    """The beams of each loading state, deformed, coloured by bending energy per length over its
    mean; files: a network a state."""
    bodies = [_tubes(path) for path in files]
    norm, view = LogNorm(1 / SPAN, SPAN), oblique(1)
    fit = np.vstack([points for points, _, _ in bodies])
    columns = min(len(bodies), 2)
    rows = -(-len(bodies) // columns)
    fig, axes = style.panels(rows, columns, aspect(view, fit), spare=10, bar=14)
    for ax in axes.flat[len(bodies) :]:
        ax.set_axis_off()
    for panel, (state, (points, faces, values)) in enumerate(zip(case.states, bodies, strict=True)):
        layer = Layer(points, faces, values=values, norm=norm, cmap="plasma")
        ax = axes.flat[panel]
        render([layer], view, style.WIDTH / columns, fit, shadows=True).show(ax)
        style.headline(ax, case.labels[state], panel)
    style.scale_bar(axes[0, 0], case.voxel_um, 0.4)
    style.axis_arrows(axes[0, -1], view.right, view.up)
    label = "bending energy per length of the strut, over its mean (–)"
    style.colour_bar(fig, axes, norm, "plasma", label, shrink=0.6)
    style.save(fig, outputs)


def _tubes(path: str | Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Triangles of a deformed network as tubes: points, faces, and for each face the bending energy
    of its strut per length, over the mean of all struts weighted by length."""
    import pyvista

    points, lines, point, cell = read_vtu(path)
    length = np.linalg.norm(np.diff(points[lines], axis=1)[:, 0], axis=1)
    density = cell["bending"].ravel() / cell["strut_length"].ravel()
    density /= max(np.average(density, weights=length), 1e-30)
    ends = (points + point["displacement"])[lines].reshape(-1, 3)
    pairs = np.column_stack([np.full(len(lines), 2), np.arange(2 * len(lines)).reshape(-1, 2)])
    beams = pyvista.PolyData(ends, lines=pairs.ravel())
    beams["radius"] = np.repeat(cell["radius"].ravel(), 2)
    beams["density"] = np.repeat(density, 2)
    tube = beams.tube(scalars="radius", absolute=True, n_sides=8).triangulate()
    faces = tube.regular_faces
    return np.asarray(tube.points), faces, np.asarray(tube["density"])[faces[:, 0]]


def mechanics(case: Case, outputs: Iterable[str], history: str) -> None:
    """(a) Nominal stress, (b) shares of the elastic energy, (c) steps to each equilibrium."""
    with Path(history).open() as file:
        rows = list(csv.DictReader(file))
    table = {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}
    strain = 100 * table["strain"]
    fig = style.figure(64)
    stress, energy, cost = fig.subplots(1, 3)
    area = np.pi * case.specimen.radius**2
    stress.plot(np.r_[0, strain], np.r_[0, 1e4 * table["force_low"] / area], color=style.DARK)
    stress.set(ylabel="nominal stress / E (10⁻⁴)")
    _shares(energy, strain, table)
    cost.semilogy(strain, table["steps"], "o-", ms=2.5, color=style.DARK)
    cost.set(ylabel="steps to equilibrium (–)")
    titles = "stress", "energy", "convergence"
    for panel, (ax, title) in enumerate(zip((stress, energy, cost), titles, strict=True)):
        ax.set(xlabel="nominal strain (%)", xlim=(0, 1.03 * strain[-1]))
        ax.set_ylim(bottom=0 if panel < 2 else 1)
        for n in case.states:
            ax.axvline(_percent(case.labels[n]), color="#555555", lw=0.7, ls=":")
        style.headline(ax, title, panel)
    style.save(fig, outputs)


def _percent(label: str) -> float:
    """The strain of a state, from its label."""
    return float(label.removesuffix("%"))


def _shares(ax: Axes, strain: np.ndarray, table: dict[str, np.ndarray]) -> None:
    """Shares of the elastic energy, one above the other."""
    total = sum(table[name] for name in ENERGIES)
    shares = [table[name] / total for name in ENERGIES]
    ax.stackplot(strain, shares, labels=ENERGIES, colors=style.SERIES[1:5], alpha=0.85)
    ax.set(ylabel="share of the elastic energy (–)", ylim=(0, 1))
    ax.legend(loc="lower left", frameon=True, framealpha=0.95, edgecolor="none")
