"""Beyond the paper: what the noise of the images leaves uncertain, and whether errors obey it."""

from collections.abc import Iterable

import numpy as np
from matplotlib.axes import Axes

from addvc.analysis.noise import load_uncertainty
from addvc.analysis.strut_store import load_partition
from addvc.fem.mesh import outer_faces
from addvc.report import style
from addvc.report.case import Case
from addvc.report.scene import Layer, oblique, render

NORMAL, ALONG = style.BLUE, style.ORANGE


def uncertainty(case: Case, outputs: Iterable[str], truth: bool) -> None:
    """(a) Standard uncertainty of each node on the micro mesh, (b) of each strut, normal to it and
    along it, against its radius, in the state that is shown; (c) with a truth, the errors of nodes
    against their uncertainty, in every state."""
    state = case.shown_state()
    nodes, struts = load_uncertainty(case.path(f"analysis/uncertainty_state{state}.h5"))
    found = case.json(f"analysis/uncertainty_state{state}.json")
    fig = style.figure(128 if truth else 96)
    left, right = fig.subfigures(1, 2, width_ratios=(1.15, 1))
    _map(left, case, nodes, f"{case.micro[0]}, {case.labels[state]}")
    panels = right.subplots(2 if truth else 1, 1, squeeze=False)[:, 0]
    _by_radius(panels[0], load_partition(case.path("geometry/struts.h5"))[0], struts)
    style.headline(panels[0], "uncertainty of the struts", 1)
    if truth:
        _calibration(panels[1], case)
        style.headline(panels[1], "errors of the nodes", 2)
        right.legend(loc="outside lower center", handles=panels[1].get_legend_handles_labels()[0])
    text = (
        f"all nodes: rms {found['rms']:.3f}, p95 {found['p95']:.3f} voxels\n"
        f"by {found['draws']} draws of noise, which leave ±{found['sampling_error']:.0%} on one node"
    )
    left.supxlabel(text, fontsize=8)
    style.save(fig, outputs)


def _map(fig, case: Case, nodes: np.ndarray, title: str) -> None:
    """The nodes on the surface of the micro mesh at rest."""
    mesh, view = case.mesh("micro"), oblique(case.specimen.axis)
    norm = style.robust_range([nodes])
    layer = Layer(mesh.points, outer_faces(mesh)[0], values=nodes, norm=norm, cmap=style.MAGNITUDE)
    ax = fig.subplots()
    render([layer], view, 85).show(ax)
    style.headline(ax, f"uncertainty, {title}", 0)
    style.scale_bar(ax, case.voxel_um, 0.4)
    style.axis_arrows(ax, view.right, view.up)
    label = f"standard uncertainty of a node ({style.voxels(case.voxel_um)})"
    place = {"location": "bottom", "shrink": 0.8, "aspect": 30}
    style.colour_bar(fig, ax, norm, style.MAGNITUDE, label, **place)


def _by_radius(ax: Axes, struts: list, found: np.ndarray) -> None:
    """A point a strut, and the median of struts of like radius."""
    radius = np.array([strut.radius for strut in struts])
    looks = (NORMAL, "normal to it"), (ALONG, "along it")
    for values, (colour, name) in zip(found.T, looks, strict=True):
        ax.plot(radius, values, ".", color=colour, ms=2.5, alpha=0.5, mew=0)
        parts = [p for p in np.array_split(np.argsort(radius), 8) if len(p)]
        line = np.array([[np.median(radius[p]), np.median(values[p])] for p in parts])
        ax.plot(*line.T.reshape(2, -1), color=colour, label=name)
    ax.set(xlabel="radius of the strut (voxels)", ylabel="uncertainty (voxels)")
    ax.set_ylim(bottom=0)
    ax.legend()


def _calibration(ax: Axes, case: Case) -> None:
    """rms error of valid nodes of like uncertainty, a line a state; on the diagonal noise is all."""
    most = 0.0
    for state in case.states:
        found = case.json(f"analysis/uncertainty_truth_state{state}.json")
        bins = np.array(found["bins"], dtype=float).reshape(-1, 2)
        colour = case.colour(state)
        ax.plot(*bins.T, "o-", ms=3, lw=1, color=colour, label=case.title(state, case.micro[0]))
        most = max(most, bins[:, 0].max(initial=0))
    ax.axline((0, 0), slope=1, color="#777777", lw=0.8, ls=":", label="noise alone")
    ax.set(xlabel="uncertainty (voxels)", ylabel="rms error (voxels)", xlim=(0, 1.1 * most))
    ax.set_ylim(bottom=0)
