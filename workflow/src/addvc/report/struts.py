"""Beyond the paper: how every strut carries its load, by the meso and by the micro result."""

from collections.abc import Iterable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from addvc.analysis.strut_store import load_partition, read_columns
from addvc.analysis.strut_table import KINDS, MESO
from addvc.analysis.struts import Strut
from addvc.geometry.skeleton import FREE_END
from addvc.report import style
from addvc.report.case import Case
from addvc.report.scene import Layer, aspect, oblique, render

BINS = np.linspace(0, 1, 21)
COMPARED = ("bending_share", "axial_strain")
GREY, NO_VALUE = "#9a9a9a", "#e6d5a0"
PALE = (1.0, 0.45, 0.15)
"""How full the colours of bending, stretching and torsion are."""

TRUTHS = ("_beams", "_field")
"""Endings of the columns of a truth, the better one first."""


def network(case: Case, outputs: Iterable[str]) -> None:
    """Every strut in the reference, micro beside meso: (top) share of bending, (bottom) axial strain,
    of the last state that was found; struts that cannot be trusted are magenta, those
    without a value sand."""
    state, view = case.shown_state(), oblique(case.specimen.axis)
    struts, junctions = load_partition(case.path("geometry/struts.h5"))
    table = read_columns(case.path(f"struts_state{state}.csv"))
    if not struts:
        style.save(without_struts(), outputs)
        return
    body = tubes(struts, junctions)
    sources = {case.micro[0]: "", case.finest: MESO}
    fig, axes = style.panels(2, 2, aspect(view, body[0]), spare=13, bar=16)
    for row, (ax, column) in enumerate(zip(axes, COMPARED, strict=True)):
        norm = Normalize(0, 1) if row == 0 else strain_range(table)
        cmap = style.MAGNITUDE if row == 0 else style.SIGNED
        for panel, (name, suffix) in enumerate(sources.items()):
            layers = strut_layers(body, table[column + suffix], table["valid"] > 0, norm, cmap)
            render(layers, view, style.WIDTH / 2, body[0], shadows=True).show(ax[panel])
            style.headline(ax[panel], f"{name}, {case.title(state, name)}", 2 * row + panel)
        label = "share of bending (–)" if row == 0 else "axial strain (–)"
        ends = "neither" if row == 0 else "both"
        style.colour_bar(fig, ax, norm, cmap, label, shrink=0.7, extend=ends)
    style.scale_bar(axes[1, 0], case.voxel_um, 0.4)
    style.axis_arrows(axes[1, 1], view.right, view.up)
    handles = [
        Patch(color=style.DOUBT, label="flagged"),
        Patch(color=NO_VALUE, label="no value"),
        Patch(color=GREY, label="junction"),
    ]
    fig.legend(handles=handles, loc="outside lower center", ncols=3)
    style.save(fig, outputs)


def strut_layers(
    body: tuple[np.ndarray, np.ndarray, np.ndarray],
    values: np.ndarray,
    valid: np.ndarray,
    norm: Normalize,
    cmap: str,
) -> list[Layer]:
    """What `tubes` made in the colours of values (s,), nan for none; what is not valid (s,) magenta."""
    points, faces, owner = body
    junction, trusted = owner == FREE_END, valid[owner]
    known = np.isfinite(values[owner]) & trusted & ~junction
    return [
        Layer(points, faces[known], values=values[owner][known], norm=norm, cmap=cmap),
        Layer(points, faces[~trusted & ~junction], colour=style.DOUBT),
        Layer(points, faces[trusted & ~known & ~junction], colour=NO_VALUE),
        Layer(points, faces[junction], colour=GREY),
    ]


def without_struts() -> Figure:
    """A figure that says that there is nothing to show."""
    fig = style.figure(30)
    fig.text(0.5, 0.5, "no struts between junctions were found", ha="center", va="center")
    return fig


def strain_range(table: dict[str, np.ndarray]) -> Normalize:
    """Range of the axial strains of the valid struts by micro DVC, about zero: those by meso DVC, many
    times as large, would leave nothing to see of them."""
    known = table["axial_strain"][table["valid"] > 0]
    return style.robust_range([np.r_[known, 0]], signed=True, share=2.5)


def tubes(struts: list[Strut], junctions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Struts as tubes between balls: points (n, 3), triangles (f, 3), and the strut (f,) of each
    triangle, -1 for the junctions."""
    import pyvista

    parts, size = [], np.zeros(len(junctions))
    for number, strut in enumerate(struts):
        for end in strut.ends:
            if end != FREE_END:
                size[end] = max(size[end], strut.radius)
        tube = pyvista.lines_from_points(extended(strut)).tube(
            radius=strut.radius, n_sides=12, capping=True
        )
        parts.append((tube.triangulate(), number))
    for junction, radius in zip(junctions, 1.15 * size, strict=True):
        if radius > 0:
            ball = pyvista.Sphere(
                radius=radius, center=junction, theta_resolution=14, phi_resolution=14
            )
            parts.append((ball.triangulate(), FREE_END))
    first = np.cumsum([0, *(part.n_points for part, _ in parts)])
    return (
        np.vstack([part.points for part, _ in parts]),
        np.vstack([p.regular_faces + n for (p, _), n in zip(parts, first, strict=False)]),
        np.concatenate([np.full(part.n_cells, number) for part, number in parts]),
    )


def extended(strut: Strut) -> np.ndarray:
    """The centre line (g + 2, 3), straight on to its junctions."""
    line = strut.points
    ahead = (strut.length - strut.span) / 2
    ends = line[[0, -1]] - line[[1, -2]]
    ends *= ahead / np.linalg.norm(ends, axis=1, keepdims=True)
    return np.vstack([line[0] + ends[0], line, line[-1] + ends[1]])


def bending(case: Case, outputs: Iterable[str], truth: bool) -> None:
    """A panel a state: energy of the valid struts by their share of bending; and the shares of the
    foam's energy, each result beside the truth if there is one."""
    tables = {state: columns(case, state, truth) for state in case.states}
    count = len(tables) + 1
    width = min(count, 3)
    rows = -(-count // width)
    fig = style.figure(16 + 58 * rows)
    axes = fig.subplots(rows, width, squeeze=False).ravel()
    sources = results(case, next(iter(tables.values())))
    for ax in axes[1 : len(tables)]:
        ax.sharey(axes[0])
    for number, (ax, state) in enumerate(zip(axes, case.states, strict=False)):
        histogram(ax, tables[state], sources)
        style.headline(ax, case.title(state, case.micro[0]), number)
    axes[0].set_ylim(bottom=0)
    energy_shares(axes[len(tables)], case, tables, sources)
    style.headline(axes[len(tables)], "all valid struts", len(tables))
    for ax in axes[count:]:
        ax.set_axis_off()
    legend(fig, sources)
    style.save(fig, outputs)


def columns(case: Case, state: int, truth: bool) -> dict[str, np.ndarray]:
    """What was measured of the struts in a state, and what is true of them."""
    table = read_columns(case.path(f"struts_state{state}.csv"))
    if truth:
        table |= read_columns(case.path(f"analysis/struts_truth_state{state}.csv"))
    return table


def results(case: Case, table: dict) -> dict[str, tuple[str, str]]:
    """Name -> (ending of its columns, colour): meso, micro, and the truth if there is one."""
    found = {case.finest: (MESO, style.ORANGE), case.micro[0]: ("", style.BLUE)}
    ending = next((end for end in TRUTHS if f"bending{end}" in table), None)
    return found | ({"truth": (ending, style.DARK)} if ending else {})


def trusted(table: dict, sources: dict) -> np.ndarray:
    """(n,) bool: valid struts that every result and the truth know."""
    known = [np.isfinite(table[f"bending_share{ending}"]) for ending, _ in sources.values()]
    return (table["valid"] > 0) & np.logical_and.reduce(known)


def energies(table: dict, ending: str, use: np.ndarray) -> np.ndarray:
    """(3, n) of bending, stretching and torsion, of the struts `use`."""
    return np.array([table[kind + ending][use] for kind in KINDS])


def histogram(ax: Axes, table: dict, sources: dict) -> None:
    """How the energy of the foam is spread over struts by their share of bending."""
    use = trusted(table, sources)
    for name, (ending, colour) in sources.items():
        energy = energies(table, ending, use).sum(axis=0)
        share = table[f"bending_share{ending}"][use]
        part = np.histogram(share, BINS, weights=energy / max(energy.sum(), 1e-300))[0]
        ax.stairs(part, BINS, color=colour, lw=1.4, ls="--" if name == "truth" else "-")
    ax.axvline(0.5, color="#999999", lw=0.6, ls=":")
    ax.set(xlabel="share of bending in a strut (–)", ylabel="share of the foam's energy (–)")
    ax.set_xlim(0, 1)


def energy_shares(ax: Axes, case: Case, tables: dict[int, dict], sources: dict) -> None:
    """Bars a state, a result each, of bending, stretching and torsion one above the other."""
    slot = 0.8 / len(sources)
    for place, state in enumerate(case.states):
        use = trusted(tables[state], sources)
        for n, (ending, colour) in enumerate(sources.values()):
            total = energies(tables[state], ending, use).sum(axis=1)
            part = total / max(total.sum(), 1e-300)
            x, base = place + (n + 0.5) * slot - 0.4, np.cumsum([0, *part])
            for share, low, alpha in zip(part, base, PALE, strict=False):
                ax.bar(x, share, 0.9 * slot, bottom=low, color=colour, alpha=alpha, lw=0)
    ax.axhline(0.5, color="#999999", lw=0.6, ls=":")
    ax.set(xticks=range(len(case.states)), ylim=(0, 1), xlabel="loading state")
    ax.set(ylabel="share of the foam's energy (–)")
    ax.set_xticklabels([case.labels[n] for n in case.states], fontsize=7)


def legend(fig: Figure, sources: dict) -> None:
    """The names of the results and of the energies, below all panels."""
    handles = [
        style.line(colour, name, ls="--" if name == "truth" else "-")
        for name, (_, colour) in sources.items()
    ]
    handles += [
        Patch(color=style.DARK, alpha=alpha, lw=0, label=kind)
        for kind, alpha in zip(KINDS, PALE, strict=True)
    ]
    fig.legend(handles=handles, loc="outside lower center", ncols=len(handles))
