"""Beyond the paper: the ultimate error over sub-voxel shifts, without noise and with it."""

from collections.abc import Iterable

import numpy as np
from matplotlib.axes import Axes

from addvc.report import style
from addvc.report.case import Case


def ultimate(case: Case, outputs: Iterable[str]) -> None:
    """(a) Bias and (b) standard deviation of known shifts by FFT, a colour a mesh; with noise, (c) the
    standard deviation beside what was expected of it from the Hessian."""
    names = [*case.meso, *case.micro]
    found = {name: case.json(f"analysis/ultimate_{name}.json") for name in names}
    fig = style.figure(68)
    bias, clean, noisy = fig.subplots(1, 3)
    for number, (name, figures) in enumerate(found.items()):
        look = {"color": style.SERIES[number], "marker": style.MARKERS[number], "ms": 4}
        _curve(bias, figures["shifts"], "bias", label=name, **look)
        _curve(clean, figures["shifts"], "std", **look)
        _curve(noisy, figures["noisy_shifts"], "std", **look)
        noisy.axhline(figures["a_priori"], color=style.SERIES[number], ls="--", lw=1)
    bias.axhline(0, color="#999999", lw=0.6, zorder=0)
    labels = "bias (voxels)", "standard deviation (voxels)", "standard deviation (voxels)"
    titles = "without noise", "without noise", "with the noise of the scans"
    for number, (ax, label, title) in enumerate(zip(fig.axes, labels, titles, strict=True)):
        ax.set(xlabel="shift along x, y and z (voxels)", ylabel=label)
        style.headline(ax, title, number)
    for ax in (clean, noisy):
        ax.set_yscale("log")
    entries = bias.get_legend_handles_labels()[0]
    entries += [style.line("#555555", "a priori, from the Hessian", "--")]
    fig.legend(handles=entries, loc="outside lower center", ncols=len(entries))
    style.save(fig, outputs)


def _curve(ax: Axes, rows: list[dict], key: str, **look) -> None:
    """A figure of each shift, in the order of the shifts."""
    shift, value = np.array(sorted((row["shift"], row[key]) for row in rows)).T
    ax.plot(shift, value, **look)
