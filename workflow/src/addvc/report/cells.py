"""Beyond the paper: strain at the scale of a cell, and the bands in which it gathers."""

from collections.abc import Iterable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from addvc.analysis.localisation import FACTOR, LUMP
from addvc.analysis.strut_store import read_columns
from addvc.report import style
from addvc.report.case import PICTURED, Case

RANGE = Normalize(0, 2.5)
"""Of the strain over its mean."""

ACROSS = 4
"""Maps in a row, at most."""

BAND = "#ffffff"


def cell_strains(case: Case, outputs: Iterable[str], truth: bool) -> None:
    """(top) strain of cells over its mean in a plane through the middle, a panel a state; (bottom)
    its profile along the loading axis, and the shares of the bands."""
    axis, states = case.specimen.axis, case.states
    figures = {n: case.json(f"cells_state{n}.json")["localisation"] for n in states}
    normal = across(axis, [figures[n]["normal"] for n in states])
    grids = {n: grid_of(read_columns(case.path(f"cells_state{n}.csv"))) for n in states}
    rows = -(-len(states) // ACROSS)
    fig = style.figure(66 + 80 * rows)
    top, bottom = fig.subfigures(2, 1, height_ratios=[80 * rows, 66])
    maps(top, case, grids, figures, (axis, normal))
    left, right = bottom.subplots(1, 2, width_ratios=[1.3, 1])
    profiles(left, case, grids, truth)
    shares(right, case, figures, truth)
    style.headline(left, "mean over planes across the loading axis", len(states))
    style.headline(right, f"all bands: over {FACTOR:g} times the mean", len(states) + 1)
    style.save(fig, outputs)


def across(axis: int, normals: list[list[float] | None]) -> int:
    """The axis to look along: the one that the bands are tilted about most nearly, else the first that
    is not the loading axis."""
    others = [d for d in range(3) if d != axis]
    tilt = np.abs([normal for normal in normals if normal] or np.zeros((1, 3))).mean(axis=0)
    return min(others, key=lambda d: tilt[d])


def grid_of(table: dict[str, np.ndarray]) -> tuple[list[np.ndarray], np.ndarray]:
    """Coordinates of the planes of the grid, three arrays, and the axial strain (nx, ny, nz)."""
    lines = [np.unique(table[name]) for name in style.AXES]
    return lines, table["axial_strain"].reshape([len(line) for line in lines])


def maps(fig: Figure, case: Case, grids: dict, figures: dict, way: tuple[int, int]) -> None:
    """A panel a state, the loading axis up, seen along `way[1]`, in the middle."""
    axis, normal = way
    flat = 3 - axis - normal
    width = min(len(grids), ACROSS)
    axes = fig.subplots(-(-len(grids) // width), width, squeeze=False, sharey=True).ravel()
    for ax in axes[len(grids) :]:
        ax.set_axis_off()
    for number, (ax, (state, (lines, strain))) in enumerate(zip(axes, grids.items(), strict=False)):
        known = strain[np.isfinite(strain)]
        ratio = strain / (known.mean() if known.any() else np.nan)
        part = np.take(ratio, len(lines[normal]) // 2, axis=normal)
        part = part if axis < flat else part.T  # rows along the loading axis
        draw_map(ax, part, lines[flat], lines[axis])
        band_line(ax, figures[state], (flat, axis, normal), lines)
        ax.set_xlabel(f"{style.AXES[flat]} (voxels)\n{band_words(figures[state])}", fontsize=7)
        ax.set(ylabel=f"{style.AXES[axis]} (voxels), loading" if number % width == 0 else "")
        title = case.title(state, case.micro[0]).replace(": ", ":\n").replace(", ", ",\n")
        style.headline(ax, title, number)
    label = "strain along the axis\nover its mean (–)"
    style.colour_bar(fig, list(axes), RANGE, style.MAGNITUDE, label, shrink=0.8)


def draw_map(ax: Axes, part: np.ndarray, right: np.ndarray, up: np.ndarray) -> None:
    """Values (rows, columns) at these places (voxels), grey where unknown, and where a band begins."""
    ax.set_facecolor("#dcdcdc")
    ax.pcolormesh(edges(right), edges(up), part, norm=RANGE, cmap=style.MAGNITUDE, rasterized=True)
    if not np.isfinite(part).any():
        style.note(
            ax, "no strain of cells:\nthinner than a cell", 0.5, 0.5, ha="center", va="center"
        )
    if min(part.shape) > 1 and (part > FACTOR).any():
        ax.contour(right, up, part, [FACTOR], colors=BAND, linewidths=1.2)
    ax.set_aspect("equal")


def edges(middles: np.ndarray) -> np.ndarray:
    """Edges (n + 1,) of cells around equally spaced middles (n,); of one alone, two voxels wide."""
    step = middles[1] - middles[0] if len(middles) > 1 else 2.0
    return np.append(middles - step / 2, middles[-1] + step / 2)


def band_line(ax: Axes, band: dict, way: tuple[int, int, int], lines: list[np.ndarray]) -> None:
    """Where the plane through the largest band meets the plane of a map, if it crosses it and the band
    is no lump."""
    if not band["normal"] or band["flatness"] >= LUMP:
        return
    flat, axis, normal = way
    n, centre = np.array(band["normal"]), np.array(band["centre"])
    middle = lines[normal][len(lines[normal]) // 2]
    x = lines[flat][[0, -1]]
    if abs(n[axis]) < 0.2:
        return
    y = (
        centre[axis]
        - ((x - centre[flat]) * n[flat] + (middle - centre[normal]) * n[normal]) / n[axis]
    )
    limits = ax.get_xlim(), ax.get_ylim()
    ax.plot(x, y, color=BAND, ls="--", lw=1)
    ax.set(xlim=limits[0], ylim=limits[1])


def band_words(band: dict) -> str:
    """What the largest band holds, how thick and how tilted it is."""
    if not band["bands"]:
        return "no band\n\n\n\n\n"
    tilt = "a lump" if band["flatness"] >= LUMP else f"{band['angle']:.0f}° in space"
    return (
        f"largest band: {band['band_volume_share']:.0%}\nof the volume, "
        f"{band['band_strain_share']:.0%}\nof the compression,\n"
        f"{band['thickness']:.0f} voxels thick,\n{tilt}"
    )


def profiles(ax: Axes, case: Case, grids: dict, truth: bool) -> None:
    """Mean axial strain (percent) of each plane of the grid across the loading axis."""
    axis = case.specimen.axis
    for state, grid in grids.items():
        colour = case.colour(state)
        ax.plot(*profile(*grid, axis), color=colour, label=case.labels[state])
        if truth:
            true = grid_of(read_columns(case.path(f"analysis/cells_truth_state{state}.csv")))
            ax.plot(*profile(*true, axis), color=colour, ls="--")
    ax.set(xlabel=f"{style.AXES[axis]} in the reference (voxels)", ylabel="axial strain (%)")
    handles = [
        *ax.get_legend_handles_labels()[0],
        *([style.line("k", "truth", "--")] if truth else []),
    ]
    ax.legend(handles=handles, fontsize=7, ncols=1 + len(grids) // (PICTURED + 1))


def profile(lines: list[np.ndarray], strain: np.ndarray, axis: int) -> tuple:
    """Places along the axis, and the mean strain there in percent, nan where unknown."""
    planes = np.moveaxis(strain, axis, 0).reshape(len(lines[axis]), -1)
    mean = [100 * plane[np.isfinite(plane)].mean() if np.isfinite(plane).any() else np.nan
            for plane in planes]  # fmt: skip
    return lines[axis], np.array(mean)


def shares(ax: Axes, case: Case, figures: dict, truth: bool) -> None:
    """Bars a state: what all bands hold of the volume and of the compression; dots: the truth."""
    kinds = {"volume_share": (-0.2, style.SOLID, "of the volume"),
             "strain_share": (0.2, style.BLUE, "of the compression")}  # fmt: skip
    for key, (shift, colour, label) in kinds.items():
        x = np.arange(len(figures)) + shift
        ax.bar(x, [100 * (f[key] or 0) for f in figures.values()], 0.36, color=colour, label=label)
        if truth:
            true = [case.json(f"analysis/cells_truth_state{n}.json")["truth"] for n in figures]
            y = [100 * (f[key] or 0) for f in true]
            ax.plot(x, y, "o", color=style.DARK, ms=4, label="truth" if shift > 0 else None)
    ax.set(xticks=range(len(figures)), xlabel="loading state", ylabel="share in bands (%)")
    many = len(figures) > PICTURED
    ax.set_xticklabels([n if many else case.labels[n] for n in figures])
    ax.set_ylim(top=1.35 * ax.get_ylim()[1])
    ax.legend(fontsize=7, loc="upper left")
