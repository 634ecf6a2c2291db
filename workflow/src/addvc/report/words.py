"""The words that go with the numbers: closing lines in the terminal, front page of the report."""

import yaml

from addvc.errors import AddvcError
from addvc.report.methods import methods
from addvc.report.page_tables import (
    RESIDUAL_WORDS,
    convergence_table,
    cost_table,
    figure,
    hashes_list,
    meshes_table,
    results_table,
    scans_table,
)

VERDICTS = {
    "converged": "converged",
    "flagged": "measured, with doubtful places",
    "failed": "FAILED: not to be used",
}


def closing_lines(summary: dict, folder: str) -> str:
    """A few lines for the end of a run: what was made, where, each state's verdict, what next."""
    lines = [f"addvc: case {summary['case']} is done; results are in {folder}/"]
    micro = micro_name(summary)
    for state in summary["states"]:
        found = state[micro]
        lines.append(
            f"  state {state['state']} ({state['strain']:.1%} measured): "
            f"{VERDICTS[state['verdict']]}; sigma(r) {figure(found['residual_std'], '.2f')}"
            f"{alone_words(state)}, "
            f"{found['iterations']} iterations, {found['valid_nodes']:.1%} of nodes valid"
            + flag_words(state.get("struts"))
            + error_words(found["error"])
        )
    failed = failed_checks(summary)
    if failed:
        count = f"{len(failed)} of {summary['twin_checks']['count']}"
        lines.append(f"  {count} checks of the synthetic test do not hold: see the report")
    lines.append(f"  open the report: xdg-open {folder}/report.html")
    return "\n".join(lines)


def flag_words(struts: dict | None) -> str:
    """How many struts are flagged: doubtful, broken by the threshold, or not measured."""
    if not struts:
        return ""
    return f", {struts['flagged']} of {struts['valid'] + struts['flagged']} struts flagged"


def alone_words(state: dict) -> str:
    """What noise alone would leave of the residual, where the images show it."""
    alone = state.get("noise_std")
    return "" if alone is None else f" (noise alone {alone:.2f})"


def error_words(error: dict | None) -> str:
    """Median and 95th percentile of the error, where a truth is known."""
    if not error:
        return ""
    return f", error median {error['median']:.3f}, p95 {error['p95']:.3f} voxel"


def micro_name(summary: dict) -> str:
    """The default micro method: the first of them."""
    return next(mesh for mesh in summary["meshes"] if mesh.startswith("micro"))


def heading(text: str, line: str = "-") -> list[str]:
    """A heading in reStructuredText."""
    return ["", text, line * len(text), ""]


def front_page(summary: dict, config: dict, scans: dict) -> str:
    """First page of the report (reStructuredText): the answer, what to distrust, the provenance."""
    lines = heading(f"addvc: case {summary['case']}", "=")
    lines += answer(summary) + look_around(summary)
    lines += heading("Warnings and failures") + warnings(summary)
    lines += [*heading("Residual and error of each mesh"), RESIDUAL_WORDS, *results_table(summary)]
    lines += heading("Convergence") + convergence_table(summary)
    lines += heading("Meshes") + meshes_table(summary)
    lines += heading("Cost") + cost_table(summary["cost"])
    lines += heading("Methods, to paste") + methods(summary, config, scans)
    lines += heading("Scans") + scans_table(scans) + hashes_list(scans.get("sha256", {}))
    lines += [*heading("Configuration"), "::", ""]
    lines += ["   " + line for line in yaml.safe_dump(config, sort_keys=False).splitlines()]
    lines += heading("Versions")
    lines += [", ".join(f"{name} {number}" for name, number in summary["versions"].items())]
    return "\n".join(lines) + "\n"


def answer(summary: dict) -> list[str]:
    """What was measured, in a few sentences."""
    size = summary["voxel_size_um"]
    lines = [
        f"Displacement of the solid at {len(summary['states'])} loading states. Cell size "
        f"{summary['cell_size']:.1f} voxels ({summary['cell_size'] * size:.0f} micrometres), "
        f"threshold {summary['threshold']:.1f} grey levels for a porosity of "
        f"{summary['porosity']:.3f}; a voxel of the binned image is {size:g} micrometres.",
        "",
    ]
    for state in summary["states"]:
        found = state[micro_name(summary)]
        lines.append(
            f"- State {state['state']} ({state['label']}; {state['strain']:.1%} measured): "
            f"**{VERDICTS[state['verdict']]}**, {found['valid_nodes']:.1%} of the nodes "
            f"valid{error_words(found['error'])}.{strut_words(state.get('struts'))}"
            + band_words(state.get("cells"))
        )
    return [*lines, "", cost_words(summary["cost"])]


def cost_words(cost: dict) -> str:
    """What it took, in a sentence."""
    cpu, memory = (sum(c["cpu_s"] for c in cost.values()), [c["max_rss_mb"] for c in cost.values()])
    micro = cost.get("micro_dvc", {"cpu_s": 0.0, "jobs": 0})
    each = f", {micro['cpu_s'] / micro['jobs']:.0f} s a job of micro DVC" if micro["jobs"] else ""
    return (
        f"It took {cpu / 60:.1f} minutes of CPU without figures{each}, and at most "
        f"{max(memory, default=0) / 1000:.1f} GB of memory in a job."
    )


def look_around(summary: dict) -> list[str]:
    """Where the result can be seen in 3D: links that hold beside the report, with the folder."""
    if not summary["states"]:
        return []
    name = micro_name(summary)
    return [
        "",
        "Look around in 3D, in this browser and without a network: `scene.html <scene.html>`__ (beside "
        f"this file). ParaView opens all states at once: `fields/{name}.pvd <fields/{name}.pvd>`__, "
        "then Filters, Warp By Vector with `displacement`; each other mesh has a file like it.",
    ]


def strut_words(struts: dict | None) -> str:
    """How the foam carries its load, as far as its struts could be measured."""
    if not struts:
        return ""
    count = f"{struts['valid']} valid struts ({struts['flagged']} flagged)"
    if struts["bending_share"] is None:
        return f" No share of bending: {count}."
    verdict = "Bending" if struts["bending_share"] > 0.5 else "Not bending"
    doubt = struts.get("bending_share_std")
    more = f" (standard deviation {doubt:.1%})" if doubt else ""
    share = f"{struts['bending_share']:.0%}{more} of the energy of {count} is in bending"
    return f" {verdict}-dominated: {share}."


def band_words(cells: dict | None) -> str:
    """Where the strain of cells gathers, if it does."""
    if not cells or cells["normal"] is None:
        return ""
    shape = (
        f"{cells['thickness']:.0f} voxels thick, its normal {cells['angle']:.0f} degrees from the "
        "loading axis"
        if cells["flatness"] < 0.7
        else "a lump rather than a plate"
    )
    return (
        f" {cells['band_strain_share']:.0%} of the compression is in a band with "
        f"{cells['band_volume_share']:.0%} of the volume, {shape}."
    )


def warnings(summary: dict) -> list[str]:
    """What to distrust; "None." when there is nothing, so that the section is never silently empty."""
    found = [line for state in summary["states"] for line in state_warnings(state, summary)]
    micro = summary["meshes"][micro_name(summary)]
    kept = micro["kept_fraction"] * micro["voxel_kept_fraction"]
    if kept < 0.9:
        found.append(
            f"- {1 - kept:.0%} of the segmented solid is not attached to the largest piece "
            "and was left out; lower mesh.size, the porosity or images.blur."
        )
    found += topology_warnings(summary.get("topology"))
    if not any(state[micro_name(summary)]["error"] for state in summary["states"]):
        found.append(
            "- The error on these images is not known: the residual and the ultimate error "
            "bound it from below only. `virtual` in the configuration measures it for a "
            "smooth field on your own reference."
        )
    found += [
        f"- The synthetic test is not what it claims to be: {check_words(check)}."
        for check in failed_checks(summary)
    ]
    return found or ["None."]


def topology_warnings(counts: dict | None) -> list[str]:
    """One line when the mesh of the struts has stubs, necks or welds."""
    names = {
        "stubs": "dangling stubs",
        "necks": "necks thinner than a square voxel",
        "welds": "welds torn by the displacement",
    }
    some = [f"{counts[key]} {name}" for key, name in names.items() if counts and counts[key]]
    if not some:
        return []
    return [
        f"- The mesh of the struts has {', '.join(some)} (0 of each in a foam): see the figure of "
        "its topology, and geometry/topology.json for where. Elastic energy (`corotational`) holds "
        "them, so its results can be used; trust `eq10` least there. For fewer of them, first lower "
        "images.blur, then mesh.size; a porosity that is too high breaks struts too."
    ]


def state_warnings(state: dict, summary: dict) -> list[str]:
    """What to distrust of one state: loops that did not end, nodes in doubt, a failure."""
    found = []
    for mesh in summary["meshes"]:
        one = state[mesh]
        if not one["converged"]:
            found.append(
                f"- State {state['state']}, {mesh}: the loop did not end in "
                f"{one['iterations']} iterations (last rms(du) {figure(one['last_step'], '.1e')} "
                "voxel). Look at the residual maps (Fig. 13); a longer "
                "regularisation length or a better start may help."
            )
    doubtful = 1 - state[micro_name(summary)]["valid_nodes"]
    if state["verdict"] == "flagged" and doubtful > 0.05:
        found.append(
            f"- State {state['state']}: {doubtful:.1%} of the nodes (at most 5 %) have a residual "
            "far above the noise of the images. Leave them out (`valid` in the fields is 0), and "
            "look at the residual maps (Fig. 13)."
        )
    struts = state.get("struts") or {"valid": 0, "flagged": 0}
    count = struts["valid"] + struts["flagged"]
    if struts["flagged"] > 0.1 * count:
        found.append(
            f"- State {state['state']}: {struts['flagged']} of {count} struts (at most 10 %) are "
            "flagged: broken by the threshold, not measured, or on nodes in doubt. What is said of "
            "bending leaves them out; the scene shows where they are."
        )
    if state["verdict"] == "failed":
        found.append(
            f"- State {state['state']} could not be registered: at least half of its nodes "
            "have a residual far above the noise of the images."
        )
    return found


def failed_checks(summary: dict) -> list[dict]:
    """Checks of the twin that do not hold; none for other images."""
    return (summary.get("twin_checks") or {"failed": []})["failed"]


def check_words(check: dict) -> str:
    """A check that does not hold: its value, its limit, its remedy."""
    unit = "" if check["unit"] == "–" else f" {check['unit']}"
    limits = [
        f"{word} {check[key]:.4g}"
        for word, key in (("at least", "low"), ("at most", "high"))
        if check[key] is not None
    ]
    return (
        f"{check['name']} is {figure(check['value'], '.4g')}{unit} ({', '.join(limits)}); "
        f"{check['remedy']}"
    )


def check_verdicts(summary: dict, strict: bool) -> None:
    """With `strict`, AddvcError when a state has failed."""
    failed = [state["label"] for state in summary["states"] if state["verdict"] == "failed"]
    if strict and failed:
        raise AddvcError(
            f"strict is on and {len(failed)} of {len(summary['states'])} states failed "
            f"({', '.join(failed)}; at most 0): see Warnings in the report, or set "
            "strict: false"
        )
