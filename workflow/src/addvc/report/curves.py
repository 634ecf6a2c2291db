"""Fig. 4, 12; beyond the paper: convergence of every mesh, choice of l_E, errors against a truth."""

from collections.abc import Iterable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter, NullLocator

from addvc.errors import grey_words
from addvc.report import style
from addvc.report.case import PICTURED, Case
from addvc.report.slices import slab_across


def cell_size(case: Case, outputs: Iterable[str]) -> None:
    """Fig. 4: (a) radial autocorrelation with its secondary peak, (b) a slab of the reference, half a
    cell thick, with a circle a cell wide."""
    fig = style.figure(72)
    left, right = fig.subplots(1, 2, width_ratios=(1.1, 1))
    volume = case.image(0, smooth=False)
    _autocorrelation(left, case.json("geometry/cell_size.json"), case.voxel_um)
    style.headline(left, "autocorrelation of the reference", 0)
    slab_across(right, volume, case.specimen, max(round(case.cell_size / 2), 1))
    radius = case.cell_size / 2
    corner = radius + 1, radius + 1
    right.add_patch(Circle(corner, radius, fill=False, color=style.RED, lw=1.2))
    right.text(*corner, "cell size", color=style.RED, fontsize=6, ha="center", va="center")
    style.scale_bar(right, case.voxel_um)
    style.axis_arrows(right, *np.eye(3)[list(case.specimen.across)])
    style.headline(right, "slab across the loading axis", 1)
    style.save(fig, outputs)


def _autocorrelation(ax: Axes, found: dict, voxel_um: float) -> None:
    """The curve, its peak, and radii in micrometres along the top."""
    radius, curve = np.array(found["radius"]), np.array(found["correlation"])
    size = found["cell_size"]
    ax.plot(radius, curve, color=style.DARK)
    measured = found["source"] == "measured"
    name = "cell size" if measured else "cell size, as configured"
    text = f"{name}\n{size:.1f} voxels = {size * voxel_um:.0f} µm"
    at = float(np.interp(size, radius, curve))
    if measured:
        ax.plot(size, at, "o", color=style.RED, ms=6, zorder=3)
    else:
        ax.axvline(size, color=style.RED, ls="--", lw=1)
    tail = curve[radius > 0.3 * size]
    reach = max(tail.max() - min(tail.min(), 0), 0.02)
    ax.set_ylim(min(tail.min(), 0) - 0.2 * reach, at + 2.6 * reach)
    arrow = {"arrowstyle": "-", "color": style.RED, "lw": 0.7}
    where = {"textcoords": "axes fraction", "color": style.RED, "arrowprops": arrow}
    ax.annotate(text, (size, at), (0.52, 0.72), **where)
    ax.set(xlabel="radius (voxels)", ylabel="normalised autocorrelation (–)", xlim=(0, radius[-1]))
    top = ax.secondary_xaxis("top", functions=(lambda x: x * voxel_um, lambda x: x / voxel_um))
    top.set_xlabel("radius (µm)")


def histograms(case: Case, outputs: Iterable[str]) -> None:
    """Fig. 12: density of r over the struts, all states, beside that of noise alone: finest meso mesh,
    each micro method."""
    names = [case.finest, *case.micro]
    fig = style.figure(92)
    axes = fig.subplots(1, len(names), sharex=True, sharey=True, squeeze=False)[0]
    reach = _reach(case)
    for number, (ax, name) in enumerate(zip(axes, names, strict=True)):
        for state in case.states:
            _density(ax, case, name, state, reach)
        _noise_alone(ax, case, reach)
        kind = "mesoscale" if name == case.finest else "microscale"
        style.headline(ax, f"{kind} ({name})", number)
        ax.set_xlabel("residual r (grey levels)")
        ax.xaxis.set_major_locator(MaxNLocator(5))
        ax.legend(
            loc="upper left", handlelength=0, handletextpad=0, labelcolor="linecolor", fontsize=7
        )
    axes[0].set(ylabel="density (1 / grey level)", xlim=(-reach, reach))
    axes[0].set_ylim(top=(1 + 0.12 * len(case.states)) * axes[0].get_ylim()[1])  # room for words
    fig.legend(handles=_density_handles(case), loc="outside lower center", ncols=3, fontsize=7)
    style.save(fig, outputs)


def _density_handles(case: Case) -> list:
    """A line a state, that of a result that is not right, that of noise alone."""
    lines = [style.line(case.colour(n), case.labels[n]) for n in case.states]
    if any(case.status(name, n) for name in (case.finest, *case.micro) for n in case.states):
        lines.append(style.line("k", "failed or not converged", "--"))
    if known := _noise_stds(case):
        lines.append(style.line(style.DARK, f"noise alone, σ = {grey_words(max(known))}", ":"))
    return lines


def _noise_stds(case: Case) -> list[float]:
    """What noise alone would leave of the residual in each state, where the images show it."""
    return [std for std in case.json("analysis/image_noise.json").values() if std is not None]


def _state_handles(case: Case) -> list:
    """A line a state, with what became of it by the default micro method."""
    name = case.micro[0]
    titles = {n: f"{case.labels[n]}: {name} {case.verdict(name, n)}" for n in case.states}
    return [style.line(case.colour(n), text) for n, text in titles.items()]


def _noise_alone(ax: Axes, case: Case, reach: float) -> None:
    """The normal distribution that noise alone would give, of the state that has most of it."""
    if not (known := _noise_stds(case)):
        return
    r, std = np.linspace(-reach, reach, 400), max(known)
    density = np.exp(-0.5 * (r / std) ** 2) / (std * np.sqrt(2 * np.pi))
    ax.plot(r, density, color=style.DARK, ls=":", lw=1, zorder=1)


def _reach(case: Case) -> float:
    """Half width of the histograms: 2.5 standard deviations of the worst result that converged."""
    sigma = [
        case.residual(name, state)[2]["std"]
        for name in (case.finest, *case.micro)
        for state in case.states
        if not case.status(name, state)
    ]
    return 2.5 * float(max(sigma)) if sigma else 100.0


def _density(ax: Axes, case: Case, name: str, state: int, reach: float) -> None:
    """One histogram, weighted by volume; dashed when the state failed."""
    r, weight, stats = case.residual(name, state)
    counts, edges = np.histogram(r, bins=120, range=(-reach, reach), weights=weight)
    density = counts / (weight.sum() * np.diff(edges))
    wrong = case.status(name, state)
    ax.plot(
        (edges[1:] + edges[:-1]) / 2,
        density,
        color=case.colour(state),
        ls="--" if wrong else "-",
        lw=1.3,
        label=_moments(stats),
    )


def _moments(stats: dict) -> str:
    """Standard deviation, mean and excess kurtosis of the residual in words."""
    mean, tail = f"{stats['mean']:+.2g}", f"{stats['kurtosis']:.1f}"
    return f"σ = {grey_words(stats['std'])}, μ = {mean}, κ = {tail}".replace("-", "−")


def convergence(case: Case, outputs: Iterable[str], tolerance: dict[str, float]) -> None:
    """rms(du) of each Gauss-Newton iteration, a panel a mesh; `tolerance` of `meso` and `micro`."""
    names = [*case.meso, *case.micro]
    columns = min(len(names), 5)
    rows = -(-len(names) // columns)
    fig = style.figure(14 + 56 * rows)
    axes = fig.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
    for number, (ax, name) in enumerate(zip(axes, names, strict=False)):
        for state in case.states:
            _steps(ax, case, name, state)
        limit = tolerance["micro" if name in case.micro else "meso"]
        ax.axhline(limit, color="#777777", lw=0.8, ls=":")
        ax.set(yscale="log", xlabel="iteration")
        ax.xaxis.get_major_locator().set_params(integer=True)
        style.headline(ax, name, number)
    for ax in axes[len(names) :]:
        ax.set_axis_off()
    for ax in axes[::columns]:
        ax.set_ylabel("rms(du) (voxels)")
    handles = [*_state_handles(case), style.line("#777777", "criterion", ls=":")]
    handles.append(style.line(style.RED, "not converged", ls="", marker="x"))
    fig.legend(handles=handles, loc="outside lower center", ncols=3)
    style.save(fig, outputs)


def _steps(ax: Axes, case: Case, name: str, state: int) -> None:
    """History of one result, with a cross at its end when it failed."""
    solution = case.solution(name, state)
    steps = np.arange(1, solution.iterations + 1)
    colour = case.colour(state)
    ax.plot(steps, solution.history, "o-", color=colour, ms=2.5, lw=1.1)
    if not solution.converged:
        ax.plot(steps[-1:], solution.history[-1:], "x", color=style.RED, ms=7, mew=2, zorder=4)


def cutoff(case: Case, outputs: Iterable[str]) -> None:
    """Unbiased risk of each l_E that the default micro method tried, above the least of its state."""
    fig, lengths = style.figure(75, 110), set()
    ax = fig.subplots()
    for state in case.states:
        colour = case.colour(state)
        trials = case.notes(case.micro[0], state)["risk"]
        if not trials:
            continue
        tried, risk = np.array(sorted((row["l_e"], row["risk"]) for row in trials)).T
        risk = (risk - risk.min()) / (risk.min() or 1.0)
        ax.plot(tried, 100 * risk, "o-", color=colour, ms=4, label=case.title(state, case.micro[0]))
        least = risk == 0
        ax.plot(tried[least], risk[least], "o", mfc="none", mec=colour, ms=10)
        lengths |= set(np.round(tried, 3))
    ax.set(xscale="log", xlabel=f"$l_E$ that was tried ({style.voxels(case.voxel_um)})")
    ax.set_ylabel("risk above its least (%)")
    ax.set_xticks(sorted(lengths), [f"{length:.3g}" for length in sorted(lengths)])
    ax.xaxis.set_minor_locator(NullLocator())
    fig.legend(loc="outside lower center", ncols=2)
    style.save(fig, outputs)


def errors(case: Case, outputs: Iterable[str], names: Sequence[str]) -> None:
    """Error against the truth at the micro nodes: rms with p95, and its parts at each strut.

    names: results in the order they are drawn, the free-form start among them."""
    fig, axes = _error_panels(case, names)
    looks = style.looks(case.meso, case.micro, names)
    for place, name in enumerate(names):
        for column, state in enumerate(case.states):
            found = case.json(f"analysis/error_{name}_state{state}.json")
            x = column + 0.72 * ((place + 0.5) / len(names) - 0.5)
            _error(axes, x, found, looks[name], not case.status(name, state))
    handles = [
        style.line(looks[name]["color"], name, ls="", marker=looks[name]["marker"])
        for name in names
    ]
    handles.append(style.line("#555555", "p95 / along the strut", ls="", marker="_"))
    handles.append(style.line(style.RED, "failed or not converged", ls="", marker="x"))
    fig.legend(handles=handles, loc="outside lower center", ncols=2 * len(axes))
    style.save(fig, outputs)


def _error_panels(case: Case, names: Sequence[str]) -> tuple:
    """The figure and its empty panels, logarithmic, a tick a state; the second where the truth knows
    the direction of the struts."""
    known = [
        case.json(f"analysis/error_{name}_state{n}.json") for name in names for n in case.states
    ]
    count = 2 if any(found.get("rms_normal") is not None for found in known) else 1
    fig = style.figure(88, 85 * count)
    axes = fig.subplots(1, count, sharey=True, squeeze=False)[0]
    titles = "whole error: rms, and p95 above it", "rms normal to the strut, and along it"
    for number, (ax, text) in enumerate(zip(axes, titles, strict=False)):
        style.headline(ax, text, number)
        ax.set(yscale="log", xticks=range(len(case.states)), xlabel="loading state")
        many = len(case.states) > PICTURED
        titles = [n if many else style.narrow(case.title(n, case.micro[0])) for n in case.states]
        ax.set_xticklabels(titles, fontsize=7)
        ax.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        ax.yaxis.set_major_formatter("{x:g}")
        ax.yaxis.set_minor_formatter(NullFormatter())
        ax.grid(axis="y", which="both", lw=0.3, color="#dddddd")
    axes[0].set_ylabel(f"error ({style.voxels(case.voxel_um)})")
    return fig, axes


def _error(axes, x: float, found: dict, look: dict, good: bool) -> None:
    """Marks of one result in both panels."""
    colour, marker = look["color"], look["marker"]
    for ax, main, other in zip(axes, ("rms", "rms_normal"), ("p95", "rms_along"), strict=False):
        if found.get(main) is None:
            continue
        ax.plot([x, x], [found[main], found[other]], color=colour, lw=0.8)
        ax.plot(x, found[other], "_", color=colour, ms=7, mew=1.5)
        ax.plot(x, found[main], marker, color=colour, ms=4.5)
        if not good:
            ax.plot(x, found[main], "x", color=style.RED, ms=8, mew=1.8, zorder=4)
