"""Beyond the paper: the ultimate error over sub-voxel shifts, without noise and with it."""

from collections.abc import Iterable

import numpy as np
from matplotlib.axes import Axes

from addvc.report import style
from addvc.report.case import Case

SCALE = 1e3
"""Errors are shown in thousandths of a voxel."""


def ultimate(case: Case, outputs: Iterable[str]) -> None:
    """(a) Bias and (b) standard deviation of known shifts by FFT, a colour a mesh; with noise, (c) the
    standard deviation beside what was expected of it from the Hessian."""
    names = [*case.meso, *case.micro]
    fig = style.figure(68)
    bias, clean, noisy = fig.subplots(1, 3)
    looks = style.looks(case.meso, case.micro)
    for name in names:
        figures = case.json(f"analysis/ultimate_{name}.json")
        look = looks[name] | {"ms": 4}
        _curve(bias, figures["shifts"], "bias", label=name, **look)
        _curve(clean, figures["shifts"], "std", **look)
        _curve(noisy, figures["noisy_shifts"], "std", **look)
        noisy.axhline(SCALE * figures["a_priori"], color=look["color"], ls="--", lw=1)
    bias.axhline(0, color="#999999", lw=0.6, zorder=0)
    titles = "without noise", "without noise", "with noise"
    for number, (ax, title) in enumerate(zip((bias, clean, noisy), titles, strict=True)):
        what = "bias" if number == 0 else "standard deviation"
        ax.set(xlabel="shift in x, y, z (voxels)", ylabel=f"{what} (10⁻³ voxels)")
        ax.set_xlim(left=0)
        style.headline(ax, title, number)
    for ax in (clean, noisy):
        ax.set_ylim(bottom=0)
    entries = bias.get_legend_handles_labels()[0]
    entries += [style.line("#555555", "a priori, from the Hessian", "--")]
    fig.legend(handles=entries, loc="outside lower center", ncols=len(entries))
    style.save(fig, outputs)


def _curve(ax: Axes, rows: list[dict], key: str, **look) -> None:
    """A figure of each shift, in the order of the shifts."""
    shift, value = np.array(sorted((row["shift"], row[key]) for row in rows)).T
    ax.plot(shift, SCALE * value, **look)
