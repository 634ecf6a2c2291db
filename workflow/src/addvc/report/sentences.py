"""What the first page and the closing lines say of a state, its struts, its cells and the cost."""

from addvc.analysis.localisation import LUMP
from addvc.errors import grey_words
from addvc.report.methods import region_named
from addvc.report.page_tables import figure

REASONS = {
    "broken": "broken by the threshold",
    "residual": "in doubt",
    "equilibrium": "far from equilibrium",
    "shape": "unlike a beam",
}


def flag_words(struts: dict | None) -> str:
    """How many struts are flagged, and why."""
    if not struts:
        return ""
    count = f"{struts['flagged']} of {struts['valid'] + struts['flagged']}"
    return f", {count} struts flagged{reason_words(struts)}"


def reason_words(struts: dict) -> str:
    """Why struts are flagged, by number."""
    counts = struts["flags"]
    told = [f"{counts[flag]} {words}" for flag, words in REASONS.items() if counts[flag]]
    return f": {', '.join(told)}" if told else ""


def alone_words(state: dict) -> str:
    """What noise alone would leave of the residual, where the images show it."""
    alone = state.get("noise_std")
    return "" if alone is None else f" (noise alone {grey_words(alone)})"


def error_words(error: dict | None) -> str:
    """Median and 95th percentile of the error, where a truth is known."""
    if not error:
        return ""
    median, p95 = (figure(error[key], ".3f") for key in ("median", "p95"))
    return f", error median {median}, p95 {p95} voxel"


def state_words(state: dict) -> str:
    """Number of a state, its nominal strain where there is one, the measured one, and that of the gap
    between the platens where the images show it."""
    sense = "compression" if state["strain"] >= 0 else "extension"
    named = "" if state["label"] == f"state {state['state']}" else f"{state['label']}; "
    platens = state.get("platens")
    same = platens and (platens["strain"] >= 0) == (state["strain"] >= 0)
    sign = 1 if state["strain"] >= 0 or not same else -1
    gap = f", {sign * platens['strain']:.1%} by the platens" if platens else ""
    return f"{state['state']} ({named}{abs(state['strain']):.1%} {sense} measured{gap})"


def noise_words(state: dict, voxel_um: float) -> str:
    """By how much the noise of the images moves a node: the standard uncertainty, rms over the nodes."""
    rms = (state.get("uncertainty") or {}).get("rms")
    if rms is None:
        return ""
    return f", known to {rms:.3f} voxel ({rms * voxel_um:.2g} micrometres) as far as noise goes"


def region_words(region: dict | None) -> list[str]:
    """Which part of the specimen micro DVC, struts and cells are of, where it is not the whole."""
    if region is None:
        return []
    return [
        "",
        f"**Micro DVC, its struts and cells are of a part of the specimen** ({region_named(region)}). "
        "The compression named here is that of the whole specimen.",
    ]


def bridge_words(summary: dict) -> list[str]:
    """How many struts are in the mesh though the threshold had broken them, of how many."""
    count = (summary.get("topology") or {}).get("bridges")
    if not count:
        return []
    struts = next((state["struts"] for state in summary["states"] if state.get("struts")), None)
    known = struts["valid"] + struts["flagged"] if struts else 0
    share = f"; {struts['bridged'] / known:.0%} of the struts have one" if known else ""
    return [
        "",
        f"{count} strut{'s' * (count > 1)} that the threshold had broken or lost, but a lower one shows "
        f"whole, went into the mesh as {'a rod' if count == 1 else 'rods'} (`mesh.mend`{share}): "
        '"stubs, necks and welds" beyond the paper shows where, `bridge` in the table of struts tells '
        "which. Struts flagged as broken are others, and rods that hold by less than a quarter of their "
        "section.",
    ]


def cost_words(cost: dict) -> str:
    """What it took, in a sentence."""
    cpu, wall = (sum(c[key] for c in cost.values()) for key in ("cpu_s", "wall_s"))
    memory = [c["max_rss_mb"] for c in cost.values()]
    micro = cost.get("micro_dvc", {"cpu_s": 0.0, "jobs": 0})
    each = f", {micro['cpu_s'] / micro['jobs']:.0f} s a job of micro DVC" if micro["jobs"] else ""
    return (
        f"It took {cpu / 60:.1f} minutes of CPU ({wall / 60:.1f} minutes of jobs, one after the "
        f"other) without figures{each}, and at most "
        f"{max(memory, default=0) / 1000:.1f} GB of memory in a job."
    )


def strut_words(struts: dict | None) -> str:
    """How the foam carries its load, as far as its struts could be measured."""
    if not struts:
        return ""
    flagged = f"{struts['flagged']} flagged{reason_words(struts)}"
    count = f"{struts['valid']} valid struts ({flagged})"
    if struts["bending_share"] is None:
        return f" No share of bending: {count}."
    verdict = "Bending" if struts["bending_share"] > 0.5 else "Not bending"
    share = f"{struts['bending_share']:.0%} of the energy of {count} is in bending"
    raw, doubt = struts.get("bending_share_raw"), struts.get("bending_share_std")
    told = [] if raw is None else [f"{raw:.0%} as measured, before equilibrium takes noise off"]
    told += [f"noise and scatter alone move it by {doubt:.1%}"] if doubt else []
    more = f" ({'; '.join(told)})" if told else ""
    return f" {verdict}-dominated: {share}{more}."


def band_words(cells: dict | None) -> str:
    """Where the strain of cells gathers, if it does."""
    if not cells or cells["normal"] is None:
        return ""
    shape = (
        f"{cells['thickness']:.0f} voxels thick, its normal {cells['angle']:.0f} degrees from the "
        "loading axis"
        if cells["flatness"] < LUMP
        else "a lump rather than a plate"
    )
    which = "One band" if cells["bands"] == 1 else f"Largest of {cells['bands']} bands"
    return (
        f" {which} of over {cells['factor']:g} times the mean strain of cells, "
        f"{abs(cells['mean_strain']):.1%}: "
        f"{cells['band_volume_share']:.0%} of the volume, with {cells['band_strain_share']:.0%} of the "
        f"compression, {shape}."
    )
