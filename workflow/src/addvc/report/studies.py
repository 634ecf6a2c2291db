"""Beyond the paper: what the ingredients and the parameters of micro DVC do, from rows of figures."""

from collections.abc import Iterable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import SubFigure
from matplotlib.ticker import LogLocator, MaxNLocator

from addvc.report import style

NAMES = {
    "l_k": ("$l_K$", "voxel"),
    "l_l": ("$l_L$", "voxel"),
    "l_e": ("$l_E$", "voxel"),
    "nu": (r"$\nu$", "–"),
    "threshold": ("threshold", "grey level"),
    "size": ("mesh size", "voxel"),
}
"""Parameters with their unit."""

SEMINORMS = {
    "l_k": r"$\|D_K K u\|$ (that of a wave of 1 voxel)",
    "l_l": r"$\|D_L L u\|$ (that of a wave of 1 voxel)",
    "l_e": "elastic strain, rms (–)",
}
"""What the lengths hold down: the other axis of an L-curve."""

FIGURES = ["Iterations", "Converged", "σ(r) (grey levels)", "Nodes flagged (–)"]
ERRORS = {
    "rms": "Error, rms (voxels)",
    "median": "Error, median (voxels)",
    "p95": "Error, 95th percentile (voxels)",
    "rms_normal": "Error normal to the strut, rms (voxels)",
}


def figures(row: dict, judged: bool) -> list[str]:
    """The cells of FIGURES and, where a truth is known, of ERRORS."""
    sigma = row["residual_std"]
    cells = [
        str(row["iterations"]),
        "yes" if row["converged"] else "NO",
        "–" if sigma is None else f"{sigma:.4g}",
        f"{row['flagged']:.4f}",
    ]
    values = [row["error"][key] for key in ERRORS] if judged else []
    return cells + ["–" if value is None else f"{value:.3f}" for value in values]


def header(found: Sequence[dict]) -> tuple[list[str], bool]:
    """Names of the columns of `figures`, and whether a truth is known."""
    judged = all(row["error"] for row in found)
    return FIGURES + (list(ERRORS.values()) if judged else []), judged


def ablation_rows(found: Sequence[dict], labels: dict[int, str]) -> list[list[str]]:
    """A row for each method and state."""
    names, judged = header(found)
    rows = [["Method", "State", *names]]
    return rows + [[r["method"], labels[r["state"]], *figures(r, judged)] for r in found]


def sensitivity_rows(found: Sequence[dict]) -> list[list[str]]:
    """A row for each value of each parameter."""
    names, judged = header(found)
    rows = [["Parameter", "Unit", "Value", "Times", "Method", "Nodes", "Solid kept (–)",
             *names, "Seminorm"]]  # fmt: skip
    for r in found:
        name = r["parameter"]
        norm = r["seminorms"].get(name)
        rows.append([
            name, NAMES[name][1], f"{r['settings'][name]:.4g}", f"{r['factor']:g}", r["method"],
            str(r["nodes"]), f"{r['kept']:.3f}", *figures(r, judged),
            "–" if norm is None else f"{norm:.4g}",
        ])  # fmt: skip
    return rows


def known(value: float | None) -> float:
    """A number to draw; nan where a lost state has none."""
    return np.nan if value is None else value


def ablation(found: Sequence[dict], labels: dict[int, str], outputs: Iterable[str]) -> None:
    """Every method in every state: error where a truth is known, residual, nodes flagged, iterations;
    a red cross where the loop did not end."""
    _, judged = header(found)
    methods = list(dict.fromkeys(row["method"] for row in found))
    states = sorted(labels)
    fig = style.figure(120 if judged else 66)
    axes = fig.subplots(2, 2).ravel() if judged else fig.subplots(1, 3)
    for number, (ax, name) in enumerate(zip(axes, _quantities(judged), strict=True)):
        for row in found:
            place = (methods.index(row["method"]) + 0.5) / len(methods) - 0.5
            _mark(ax, states.index(row["state"]) + 0.75 * place, row, name, methods)
        style.headline(ax, name, number)
        ax.set_xticks(range(len(states)), [labels[state] for state in states])
        _scale(ax, logarithmic=not name.startswith("nodes"))
    handles = [
        style.line(style.SERIES[n % 6], method.replace("_", " "), "", style.MARKERS[n % 6])
        for n, method in enumerate(methods)
    ]
    handles += [style.line("#555555", "95th percentile", "", "_")] if judged else []
    handles.append(style.line(style.RED, "not converged", "", "x"))
    fig.legend(handles=handles, loc="outside lower center", ncols=4)
    style.save(fig, outputs)


def _scale(ax: Axes, logarithmic: bool) -> None:
    """Axes of a panel of the ablation."""
    ax.set_xlabel("loading state")
    if logarithmic:
        ax.set_yscale("log")
        ax.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        ax.yaxis.set_minor_formatter("")
    ax.yaxis.set_major_formatter("{x:g}")
    ax.grid(axis="y", lw=0.3, color="#dddddd")


def _quantities(judged: bool) -> list[str]:
    """What is drawn of the ablation, with its unit."""
    rest = ["σ(r) (grey levels)", "nodes flagged (%)", "iterations (–)"]
    return ["error, rms (voxels)", *rest] if judged else rest


def _value(row: dict, name: str) -> float:
    """A quantity of `_quantities` of one row."""
    if name.startswith("error"):
        return row["error"]["rms"]
    if name.startswith("σ"):
        return known(row["residual_std"])
    return 100 * row["flagged"] if name.startswith("nodes") else row["iterations"]


def _mark(ax: Axes, x: float, row: dict, name: str, methods: list[str]) -> None:
    """One method in one state."""
    n = methods.index(row["method"])
    colour, y = style.SERIES[n % 6], _value(row, name)
    ax.plot(x, y, style.MARKERS[n % 6], color=colour, ms=4.5)
    if name.startswith("error"):
        ax.plot([x, x], [y, row["error"]["p95"]], color=colour, lw=0.8)
        ax.plot(x, row["error"]["p95"], "_", color=colour, ms=7, mew=1.5)
    if not row["converged"]:
        ax.plot(x, y, "x", color=style.RED, ms=8, mew=1.5, zorder=4)


def sensitivity(found: Sequence[dict], label: str, outputs: Iterable[str]) -> None:
    """(top) L-curves of the lengths; (below) residual, nodes flagged and, where a truth is known, the
    error over each parameter: a column a parameter, open marks at the value in use."""
    by_name = {
        name: sorted((r for r in found if r["parameter"] == name), key=lambda r: r["factor"])
        for name in dict.fromkeys(row["parameter"] for row in found)
    }
    curves = [name for name in by_name if name in SEMINORMS]
    _, judged = header(found)
    heights = ([62] if curves else []) + [40 + 34 * (2 + judged)]
    fig = style.figure(sum(heights))
    parts = list(fig.subfigures(len(heights), 1, height_ratios=heights, squeeze=False)[:, 0])
    if curves:
        for number, (ax, name) in enumerate(
            zip(parts[0].subplots(1, len(curves), squeeze=False)[0], curves, strict=True)
        ):
            _l_curve(ax, by_name[name], name, number)
    _columns(parts[-1], by_name, judged, len(curves))
    fig.suptitle(f"{label}, one parameter at a time", fontsize=9)
    style.save(fig, outputs)


def apart(ax: Axes, x: Sequence[float], y: Sequence[float], room: float = 0.12) -> list[int]:
    """Points of a panel, the first of each heap, that are `room` of its width or height apart: words
    beside them do not run into each other."""
    places = ax.transLimits.transform(np.column_stack([x, y]))
    chosen: list[int] = []
    for n, place in enumerate(places):
        if all(np.abs(place - places[m]).max() > room for m in chosen):
            chosen.append(n)
    return chosen


def _l_curve(ax: Axes, rows: list[dict], name: str, number: int) -> None:
    """Residual over seminorm, the value of the length beside each mark."""
    x = [known(row["seminorms"][name]) for row in rows]
    y = [known(row["residual_std"]) for row in rows]
    ax.plot(x, y, "-", color=style.DARK, lw=0.9)
    for row, a, b in zip(rows, x, y, strict=True):
        _dot(ax, row, a, b, style.DARK)
    ax.margins(0.16)
    low, high = ax.get_ylim()
    least = 0.1 * abs(high)  # so that nothing does not look like something
    if high - low < least:
        ax.set_ylim((low + high - least) / 2, (low + high + least) / 2)
    for n in apart(ax, x, y):
        ax.annotate(f"{rows[n]['settings'][name]:.3g}", (x[n], y[n]), (4, 4), fontsize=7,
                    textcoords="offset points")  # fmt: skip
    ax.ticklabel_format(axis="y", useOffset=False)
    ax.xaxis.set_major_locator(MaxNLocator(4))
    ax.set(xlabel=SEMINORMS[name], ylabel="σ(r) (grey levels)")
    style.headline(ax, f"L-curve of {NAMES[name][0]} (voxels)", number)


def _dot(ax: Axes, row: dict, x: float, y: float, colour: str) -> None:
    """A mark: open at the value in use, a red cross over it where the loop did not end."""
    ax.plot(
        x, y, "o", color=colour, mfc="white" if row["factor"] == 1 else colour, ms=4.5, zorder=3
    )
    if not row["converged"]:
        ax.plot(x, y, "x", color=style.RED, ms=8, mew=1.5, zorder=4)


def _columns(part: SubFigure, by_name: dict[str, list[dict]], judged: bool, first: int) -> None:
    """Quantities (rows) over parameters (columns)."""
    axes = part.subplots(2 + judged, len(by_name), sharey="row", sharex="col", squeeze=False)
    for column, (name, rows) in enumerate(by_name.items()):
        x = [row["settings"][name] for row in rows]
        for ax, curves in zip(axes[:, column], _curves(rows, judged), strict=True):
            for colour, y in curves.items():
                ax.plot(x, y, "-", color=colour, lw=0.9)
                for row, a, b in zip(rows, x, y, strict=True):
                    _dot(ax, row, a, b, colour)
            ax.margins(0.1)
            ax.grid(axis="y", lw=0.3, color="#dddddd")
        title, unit = NAMES[name]
        style.headline(axes[0, column], title, first + column)
        axes[-1, column].set_xlabel(unit)
    names = ["σ(r)\n(grey levels)", "nodes flagged\n(%)", "error\n(voxels)"]
    for ax, text in zip(axes[:, 0], names, strict=False):
        ax.set_ylabel(text)
    _legend(part, judged)


def _curves(rows: list[dict], judged: bool) -> list[dict[str, list[float]]]:
    """Colour -> values, for each quantity."""
    found = [
        {style.DARK: [known(row["residual_std"]) for row in rows]},
        {style.DARK: [100 * row["flagged"] for row in rows]},
    ]
    keys = {style.BLUE: "rms", style.ORANGE: "p95"}
    errors = {c: [row["error"][key] for row in rows] for c, key in keys.items()} if judged else None
    return [*found, errors] if judged else found


def _legend(part: SubFigure, judged: bool) -> None:
    """What lines and marks mean, below all columns."""
    handles = [style.line(style.BLUE, "rms"), style.line(style.ORANGE, "95th percentile")]
    handles = handles if judged else []
    handles.append(style.line(style.DARK, "value in use", "", "o"))
    handles[-1].set_markerfacecolor("white")
    handles.append(style.line(style.RED, "not converged", "", "x"))
    part.legend(handles=handles, loc="outside lower center", ncols=4)
