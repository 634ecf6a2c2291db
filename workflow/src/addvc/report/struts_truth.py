"""Beyond the paper: measured struts against the truth, of a synthetic test."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes

from addvc.analysis.strut_table import RAW
from addvc.report import style
from addvc.report.case import Case
from addvc.report.struts import columns, results, trusted

QUANTITIES = {
    "struts": ("struts compared", "–"),
    "bending_share_correlation": ("correlation of the share of bending", "–"),
    "same_class": ("struts of the same class (bending over or under one half)", "–"),
    "decided": ("struts whose class is sure by a deviation", "–"),
    "decided_same_class": ("of these, struts of the same class", "–"),
    "axial_strain_correlation": ("correlation of the axial strain", "–"),
    "axial_strain_rms": ("rms difference of the axial strain", "–"),
}


FLAGS = {
    "wrong": "struts in error by over 1 voxel",
    "wrong_flagged": "share of these that is flagged",
    "right_flagged": "share of the others that is flagged",
}


class Compared(NamedTuple):
    """A column of the table of struts as it is drawn: times a factor, its name, its unit, its sign."""

    column: str
    factor: float
    name: str
    unit: str
    signed: bool


ROWS = (
    Compared("bending_share", 1, "share of bending", "–", signed=False),
    Compared("axial_strain", 100, "axial strain", "%", signed=True),
)


def against_truth(case: Case, outputs: Iterable[str]) -> None:
    """Measured against true, a point a valid strut, a column a state (of many, six): (top) share of
    bending, (bottom) axial strain, of the micro and of the finest meso result."""
    states, colours = case.pictured, {}
    count = len(states)
    width = max(min(62.0, style.WIDTH / count) * count, 0.6 * style.WIDTH)
    fig = style.figure(132, width)
    axes = fig.subplots(2, count, squeeze=False)
    for column, state in enumerate(states):
        table = columns(case, state, True)
        sources = results(case, table)
        use, (truth, _) = trusted(table, sources), sources["truth"]
        measured = {name: found for name, found in sources.items() if name != "truth"}
        for row, (ax, drawn) in enumerate(zip(axes[:, column], ROWS, strict=True)):
            for name, (own, colours[name]) in measured.items():
                pair = (drawn.factor * table[drawn.column + end][use] for end in (truth, own))
                scatter(ax, *pair, colours[name], drawn.signed)
            title = case.title(state, case.micro[0]).replace(", ", ",\n")
            style.headline(ax, title, count * row + column)
            ax.set_xlabel(f"{drawn.name},\ntruth ({drawn.unit})")
    for ax, drawn in zip(axes[:, 0], ROWS, strict=True):
        ax.set_ylabel(f"{drawn.name}, measured ({drawn.unit})")
    handles = [style.line(colour, name, ls="", marker="o") for name, colour in colours.items()]
    handles.append(style.line("#777777", "measured as the truth"))
    fig.legend(handles=handles, loc="outside lower center", ncols=3)
    style.save(fig, outputs)


def scatter(ax: Axes, true: np.ndarray, measured: np.ndarray, colour: str, signed: bool) -> None:
    """Measured over true values, from 0 to 1, or, where `signed`, over the range of the true ones; what
    is beyond is on the border."""
    reach = max(float(np.abs(true).max(initial=0)), 1e-6)
    span = (-reach, reach) if signed else (0, 1)
    shown = np.clip(measured, *span)
    ax.plot(true, shown, "o", color=colour, ms=2.2, alpha=0.55, mew=0, clip_on=False)
    ax.plot(span, span, color="#777777", lw=0.8, zorder=0)
    ax.set(xlim=span, ylim=span, box_aspect=1)
    ax.locator_params(nbins=4 if signed else 2)


def truth_rows(case: Case) -> list[list[str]]:
    """The table: figures of each result against both truths, a column a state."""
    read = {n: case.json(f"analysis/struts_truth_state{n}.json") for n in case.states}
    first = read[case.states[0]]
    rows = [
        [
            "Struts",
            "Against",
            "Quantity",
            "Unit",
            *(case.title(n, case.micro[0]) for n in case.states),
        ]
    ]
    names = {"field": "true displacement", "beams": "beams of the twin"}
    names |= {case.micro[0] + RAW: f"{case.micro[0]}, as measured"}
    flags = {n: read[n]["flags"] for n in case.states}
    for key, quantity in FLAGS.items():
        values = [_number(flags[n][key]) for n in case.states]
        rows.append([case.micro[0], names["field"], quantity, "–", *values])
    for source in (source for source in first if source != "flags"):
        for other in first[source]:
            found = [read[n][source][other] for n in case.states]
            for key, (quantity, unit) in QUANTITIES.items():
                values = [_number(entry[key]) for entry in found]
                rows.append([names.get(source, source), names[other], quantity, unit, *values])
            for place, whose in enumerate(("of these", "of the truth")):
                values = [_number(entry["foam"][place]) for entry in found]
                quantity = f"share of bending in the energy of all, {whose}"
                rows.append([names.get(source, source), names[other], quantity, "–", *values])
    return rows


def _number(value: float | int | None) -> str:
    if value is None:
        return "–"
    return str(value) if isinstance(value, int) else f"{value:.3g}"
