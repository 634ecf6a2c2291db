"""The words that go with the numbers: closing lines in the terminal, front page of the report."""

import re
import textwrap

import yaml

from addvc.errors import AddvcError, grey_words
from addvc.report.doubts import failed_checks, warnings
from addvc.report.methods import methods
from addvc.report.page_tables import (
    RESIDUAL_WORDS,
    convergence_table,
    convergence_words,
    cost_table,
    figure,
    hashes_list,
    meshes_table,
    micro_name,
    network_words,
    results_table,
    scans_table,
)
from addvc.report.sentences import (
    alone_words,
    band_words,
    bridge_words,
    cost_words,
    error_words,
    flag_words,
    noise_words,
    region_words,
    state_words,
    strut_words,
)

VERDICTS = {
    "converged": "converged",
    "flagged": "measured, with doubtful places",
    "failed": "FAILED: not to be used",
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
    lines += heading("Residual and error of each mesh")
    lines += [RESIDUAL_WORDS, *network_words(summary), *results_table(summary)]
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


def check_verdicts(summary: dict, strict: bool) -> None:
    """With `strict`, AddvcError when a state has failed."""
    failed = [state["label"] for state in summary["states"] if state["verdict"] == "failed"]
    if strict and failed:
        raise AddvcError(
            f"strict is on and {len(failed)} of {len(summary['states'])} states failed "
            f"({', '.join(failed)}; at most 0): see Warnings in the report, or set "
            "strict: false"
        )
