"""The words that go with the numbers: closing lines in the terminal, front page of the report."""

import re
import textwrap

import yaml

from addvc.analysis.localisation import LUMP
from addvc.errors import AddvcError, grey_words
from addvc.report.doubts import failed_checks, warnings
from addvc.report.methods import methods, region_named
from addvc.report.page_tables import (
    RESIDUAL_WORDS,
    convergence_table,
    convergence_words,
    cost_table,
    figure,
    hashes_list,
    meshes_table,
    micro_name,
    results_table,
    scans_table,
)

VERDICTS = {
    "converged": "converged",
    "flagged": "measured, with doubtful places",
    "failed": "FAILED: not to be used",
}

REASONS = {
    "broken": "broken by the threshold",
    "residual": "in doubt",
    "equilibrium": "far from equilibrium",
    "shape": "unlike a beam",
}

TERMS = (
    "A node is *valid* where the residual around it is what noise explains, off torn bridges, else "
    "*in doubt* (`valid` 0 in the files). A strut is *flagged* where the threshold broke it, over 30 % "
    "of it is in doubt, it lies far from equilibrium, or moves unlike a beam (`flag` in the table of "
    "struts). A state is *converged* where the loop ended and at most 5 % of the nodes are in doubt, "
    "*measured, with doubtful places* (`flagged` in summary.json) where not, *failed* where half are; "
    "in figures that is said of the loop alone, and *inverted* is the share of elements that a "
    "displacement turns inside out, where it is over 1 %. The compression measured is by how "
    "much the end faces of the finest mesh of meso DVC come nearer, over their distance; *by the "
    "platens* is how much the gap between these closes, as seen in the images without any DVC."
)
"""What the first page means by the words of its verdicts."""


def closing_lines(summary: dict, folder: str) -> str:
    """A few lines for the end of a run: what was made, where, each state's verdict, what next."""
    lines = [f"addvc: case {summary['case']} is done; results are in {folder}/"]
    micro = micro_name(summary)
    for state in summary["states"]:
        found = state[micro]
        lines.append(
            f"  state {state_words(state)}: "
            f"{VERDICTS[state['verdict']]}; sigma(r) {grey_words(found['residual_std'])}"
            f"{alone_words(state)}, "
            f"{found['iterations']} iterations, {found['valid_nodes']:.1%} of nodes valid"
            + flag_words(state.get("struts"))
            + error_words(found["error"])
        )
    failed = failed_checks(summary)
    if failed:
        count = f"{len(failed)} of {summary['twin_checks']['count']}"
        lines.append(f"  {count} checks of the synthetic test do not hold: see the report")
    told = [line for line in warnings(summary) if line != "None."]
    if told:
        lines.append(
            f"  {len(told)} warning{'s' * (len(told) > 1)} on the first page of the report"
        )
    lines.append(f"  open the report: xdg-open {folder}/report.html")
    return "\n".join(lines)


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


def heading(text: str, line: str = "-") -> list[str]:
    """A heading in reStructuredText."""
    return ["", text, line * len(text), ""]


def front_page(summary: dict, config: dict, scans: dict, picture: str | None = None) -> str:
    """First page of the report (reStructuredText): the answer, what to distrust, what to do next, the
    provenance; picture: one to show with the answer, as the address of an image."""
    lines = heading(f"addvc: case {summary['case']}", "=")
    lines += answer(summary) + shown(picture, summary) + look_around(summary)
    lines += heading("Warnings and failures") + warnings(summary)
    lines += heading("What next") + what_next(summary)
    lines += [*heading("Residual and error of each mesh"), RESIDUAL_WORDS, *results_table(summary)]
    lines += [*heading("Convergence"), convergence_words(summary), *convergence_table(summary)]
    lines += heading("Meshes") + meshes_table(summary)
    lines += heading("Methods, to paste") + methods(summary, config, scans)
    lines += heading("Scans") + scans_table(scans) + hashes_list(scans.get("sha256", {}))
    lines += [*heading("Configuration"), "::", ""]
    lines += ["   " + line for line in yaml.safe_dump(config, sort_keys=False).splitlines()]
    lines += heading("Cost") + cost_table(summary["cost"])
    lines += heading("Versions")
    lines += [", ".join(f"{name} {number}" for name, number in summary["versions"].items())]
    return "\n".join(lines) + "\n"


def linked(page: str, entries: list[dict[str, str]]) -> str:
    """The page with a link wherever it names a figure or table of the report, {file, title}: `Fig. 3`,
    or the title in quotes. Snakemake's report knows each by the name of its file."""
    files = {}
    for entry in entries:
        name, colon, _ = entry["title"].partition(":")
        files[name if colon else f'"{name}"'] = entry["file"]
    names = "|".join(re.escape(name) for name in files)
    return re.sub(rf"({names})(?!\d)", lambda m: f"`{m[1]} <{files[m[1]]}_>`__", page)


def answer(summary: dict) -> list[str]:
    """What was measured, in a few sentences."""
    size, count = summary["voxel_size_um"], len(summary["states"])
    lines = [
        f"Displacement of the solid at {count} loading state{'s' * (count != 1)}. Cell size "
        f"{summary['cell_size']:.1f} voxels ({figure(summary['cell_size'] * size, '.3g')} micrometres), "
        f"threshold {grey_words(summary['threshold'])} grey levels for a porosity of "
        f"{summary['porosity']:.3f}; a voxel of the binned image is {size:g} micrometres.",
        *region_words(summary.get("region")),
        "",
    ]
    for state in summary["states"]:
        found = state[micro_name(summary)]
        lines.append(
            f"- State {state_words(state)}: "
            f"**{VERDICTS[state['verdict']]}**, {found['valid_nodes']:.1%} of the nodes "
            f"valid{noise_words(state, size)}{error_words(found['error'])}."
            f"{strut_words(state.get('struts'))}" + band_words(state.get("cells"))
        )
    lines += ["", TERMS, *bridge_words(summary)]
    return [*lines, "", cost_words(summary["cost"])]


def shown(picture: str | None, summary: dict) -> list[str]:
    """A picture of the answer with a caption, where there is one."""
    if picture is None:
        return []
    caption = (
        f"Struts coloured by what they undergo, by {micro_name(summary)} (left) and by the finest meso "
        'result (right): see "network of struts" beyond the paper.'
    )
    address = textwrap.wrap(picture, 1000, initial_indent=".. image:: ", subsequent_indent="   ")
    return ["", *address, "   :width: 450px", "", caption]


def what_next(summary: dict) -> list[str]:
    """Where to look first, and which file has what."""
    if not summary["states"]:
        return ["List the loaded scans in `scans.states`, and give the same command."]
    name, last = micro_name(summary), summary["states"][-1]["state"]
    return [
        "- A link to a figure leads to its entry, with its caption: the eye there shows it.",
        "- Is it right? Fig. 13: specks, but no strut of one colour along a flank. Fig. 16: the carried "
        "struts lie in the outline of the image. What is not so is in doubt, above or `valid` 0 in the "
        "files. A small residual alone is no merit: a result with more unknowns follows more noise.",
        "- What moved? Fig. 11, Fig. 15, and the scene.",
        '- How do struts carry the load? "bending or stretching" and "network of struts" beyond the '
        f"paper; a row for each strut in ``struts_state{last}.csv``, what its columns mean in "
        f"``struts_state{last}.json``.",
        '- Where does strain gather? "strain of cells and its bands", and ``cells_state*.csv``.',
        f"- Your own analysis: ``fields/{name}_state*.vtu`` (ParaView, pyvista, meshio) has "
        "displacement, strain, residual and `valid` of every node; ``summary.json`` all of "
        "the figures of this page.",
    ]


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


def check_verdicts(summary: dict, strict: bool) -> None:
    """With `strict`, AddvcError when a state has failed."""
    failed = [state["label"] for state in summary["states"] if state["verdict"] == "failed"]
    if strict and failed:
        raise AddvcError(
            f"strict is on and {len(failed)} of {len(summary['states'])} states failed "
            f"({', '.join(failed)}; at most 0): see Warnings in the report, or set "
            "strict: false"
        )
