"""Beyond the paper: how every strut carries its load, by the meso and by the micro result."""

from collections.abc import Iterable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from addvc.analysis.strut_store import load_partition, read_columns
from addvc.analysis.strut_table import KINDS, MESO
from addvc.analysis.struts import Strut
from addvc.geometry.skeleton import FREE_END
from addvc.report import style
from addvc.report.case import Case
from addvc.report.scene import Layer, aspect, oblique, render

BINS = np.linspace(0, 1, 21)
TRUTHS = ("_beams", "_field")
"""Endings of the columns of a truth, the better one first."""


def network(case: Case, outputs: Iterable[str]) -> None:
    """Every strut in the reference, micro beside meso: (top) share of bending, (bottom) axial strain,
    of the last state that was found; struts that cannot be trusted are grey."""
    state, view = case.shown_state(), oblique(case.specimen.axis)
    struts, junctions = load_partition(case.path("geometry/struts.h5"))
    table = read_columns(case.path(f"struts_state{state}.csv"))
    points, faces, owner = tubes(struts, junctions)
    sources = {case.micro[0]: "", case.finest: MESO}
    fig, axes = style.panels(2, 2, aspect(view, points), spare=9, bar=16)
    for row, (ax, column) in enumerate(zip(axes, ("bending_share", "axial_strain"), strict=True)):
        valid = table["valid"] > 0
        norm = Normalize(0, 1) if row == 0 else strain_range(table, sources.values())
        cmap = style.MAGNITUDE if row == 0 else style.SIGNED
        for panel, (name, suffix) in enumerate(sources.items()):
            values = np.where(valid, table[column + suffix], np.nan)[owner]
            known = np.isfinite(values) & (owner != FREE_END)
            layers = [
                Layer(points, faces[known], values=values[known], norm=norm, cmap=cmap),
                Layer(points, faces[~known & (owner != FREE_END)], colour="#e3e3e3", opacity=0.6),
                Layer(points, faces[owner == FREE_END], colour="#9a9a9a"),
            ]
            render(layers, view, style.WIDTH / 2, points, shadows=True).show(ax[panel])
            style.headline(ax[panel], f"{case.title(state, name)}, {name}", 2 * row + panel)
        label = "share of bending (–)" if row == 0 else "axial strain (–)"
        style.colour_bar(fig, ax, norm, cmap, label, shrink=0.7)
    style.scale_bar(axes[1, 0], case.voxel_um(), 0.4)
    style.save(fig, outputs)


def strain_range(table: dict[str, np.ndarray], suffixes: Iterable[str]) -> Normalize:
    """Range of the axial strains of the valid struts, of all results, about zero."""
    valid = table["valid"] > 0
    return style.robust_range(
        [table[f"axial_strain{s}"][valid] for s in suffixes], signed=True, share=2.5
    )


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
            ball = pyvista.Sphere(radius, junction, theta_resolution=14, phi_resolution=14)
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
    for number, (ax, state) in enumerate(zip(axes, case.states, strict=False)):
        histogram(ax, tables[state], sources)
        style.headline(ax, case.title(state, case.micro[0]), number)
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
    ax.set(xlim=(0, 1), ylim=(0, None))


def energy_shares(ax: Axes, case: Case, tables: dict[int, dict], sources: dict) -> None:
    """Bars a state, a result each, of bending, stretching and torsion one above the other."""
    slot = 0.8 / len(sources)
    for place, state in enumerate(case.states):
        use = trusted(tables[state], sources)
        for n, (ending, colour) in enumerate(sources.values()):
            total = energies(tables[state], ending, use).sum(axis=1)
            part = total / max(total.sum(), 1e-300)
            x = place + (n + 0.5) * slot - 0.4
            for share, base, alpha in zip(part, np.cumsum([0, *part]), (1.0, 0.45, 0.15),
                                          strict=False):  # fmt: skip
                ax.bar(x, share, 0.9 * slot, bottom=base, color=colour, alpha=alpha, lw=0)
    ax.axhline(0.5, color="#999999", lw=0.6, ls=":")
    ax.set(xticks=range(len(case.states)), ylim=(0, 1), xlabel="loading state")
    ax.set(ylabel="bending (full), stretching, torsion (–)")
    ax.set_xticklabels([case.labels[n] for n in case.states])


def legend(fig: Figure, sources: dict) -> None:
    """The names of the results, below all panels."""
    handles = [
        style.line(colour, name, ls="--" if name == "truth" else "-")
        for name, (_, colour) in sources.items()
    ]
    fig.legend(handles=handles, loc="outside lower center", ncols=len(handles))


def against_truth(case: Case, outputs: Iterable[str]) -> None:
    """Measured against true, a point a valid strut, a column a state: (top) share of bending,
    (bottom) axial strain, of the micro and of the finest meso result."""
    tables = {state: columns(case, state, True) for state in case.states}
    count = len(tables)
    side = min(58.0, style.WIDTH / count)
    fig = style.figure(14 + 2 * (side + 4), max(side * count, 0.5 * style.WIDTH))
    axes = fig.subplots(2, count, squeeze=False)
    for column, (state, table) in enumerate(tables.items()):
        sources = results(case, table)
        ending, use = sources.pop("truth")[0], trusted(table, results(case, table))
        for row, (ax, name) in enumerate(
            zip(axes[:, column], ("bending_share", "axial_strain"), strict=True)
        ):
            pairs = {
                source: (table[name + ending][use], table[name + own][use], colour)
                for source, (own, colour) in sources.items()
            }
            scatter(ax, pairs, (0, 1) if row == 0 else None)
            style.headline(ax, case.title(state, case.micro[0]), count * row + column)
    axes[0, 0].set_ylabel("share of bending, measured (–)")
    axes[1, 0].set_ylabel("axial strain, measured (–)")
    for row, word in zip(axes, ("share of bending", "axial strain"), strict=True):
        for ax in row:
            ax.set_xlabel(f"{word}, truth (–)")
    sources.pop("truth", None)
    handles = [style.line(c, n, ls="", marker="o") for n, (_, c) in sources.items()]
    fig.legend(handles=handles, loc="outside lower center", ncols=2)
    style.save(fig, outputs)


def scatter(ax: Axes, pairs: dict, limits: tuple[float, float] | None) -> None:
    """Measured over true values; without limits, three times the range of the true ones."""
    if limits is None:
        reach = 3 * max(float(np.abs(next(iter(pairs.values()))[0]).max(initial=0)), 1e-4)
        limits = (-reach, reach)
    for true, measured, colour in pairs.values():
        shown = np.clip(measured, *limits)
        ax.plot(true, shown, "o", color=colour, ms=2.2, alpha=0.55, mew=0, clip_on=False)
    ax.plot(limits, limits, color="#777777", lw=0.7, zorder=0)
    ax.set(xlim=limits, ylim=limits, aspect="equal")


def truth_rows(case: Case) -> list[list[str]]:
    """The table: figures of each result against both truths, a column a state."""
    read = {n: case.json(f"analysis/struts_truth_state{n}.json") for n in case.states}
    first = read[case.states[0]]
    rows = [["Struts", "Against", "Quantity", "Unit", *(case.labels[n] for n in case.states)]]
    names = {"field": "true displacement", "beams": "beams of the twin"}
    for source, others in first.items():
        for other in others:
            found = [read[n][source][other] for n in case.states]
            for key, (quantity, unit) in QUANTITIES.items():
                values = [_number(entry[key]) for entry in found]
                rows.append([names.get(source, source), names[other], quantity, unit, *values])
            for place, whose in enumerate(("of these", "of the truth")):
                values = [_number(entry["foam"][place]) for entry in found]
                quantity = f"share of bending in the energy of all, {whose}"
                rows.append([names.get(source, source), names[other], quantity, "–", *values])
    return rows


QUANTITIES = {
    "struts": ("struts compared", "–"),
    "bending_share_correlation": ("correlation of the share of bending", "–"),
    "same_class": ("struts of the same class (bending over or under one half)", "–"),
    "axial_strain_correlation": ("correlation of the axial strain", "–"),
    "axial_strain_rms": ("rms difference of the axial strain", "–"),
}


def _number(value: float | int | None) -> str:
    if value is None:
        return "–"
    return str(value) if isinstance(value, int) else f"{value:.3g}"
