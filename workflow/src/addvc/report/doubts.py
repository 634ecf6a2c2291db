"""What to distrust in a result: the section of the first page that is never silently empty."""

from collections.abc import Iterable

from addvc.analysis.balance import refusal
from addvc.config import METHODS, mesh_name
from addvc.errors import grey_words
from addvc.report.case import FOLDED
from addvc.report.page_tables import figure, micro_name, network_name

STRETCHED = 0.003  # strain by which a specimen may seem longer, and less compressed than before
STUBS = {
    False: "Elastic energy (`corotational`) holds them, so its results can be used.",
    True: "Trust `eq10` least there.",
}  # by whether a method has an equilibrium gap
APART = 0.5  # voxels between the platens and the ends of a mesh; on twins at most .09
NOISE_OVER = 1.4  # that over sigma(r): micro DVC of the twin has 1.1, Eq. 10 1.2
NOISE_TIMES = 1.5  # sigma(r) over that of noise alone; under the truth of the twin 1.0 to 1.25


def warnings(summary: dict) -> list[str]:
    """What to distrust; "None." when there is nothing, so that the section is never silently empty."""
    found = strain_warnings(summary)
    found += [line for state in summary["states"] for line in state_warnings(state, summary)]
    micro = summary["meshes"][micro_name(summary)]
    kept = micro["kept_fraction"] * micro["voxel_kept_fraction"]
    if kept < 0.9:
        found.append(
            f"- {1 - kept:.0%} of the segmented solid is not attached to the largest piece "
            "and was left out; lower mesh.size, the porosity or images.blur."
        )
    found += [f"- {words[0].upper()}{words[1:]}." for words in summary.get("said", [])]
    found += topology_warnings(summary.get("topology"), summary["methods"].values())
    if not any(state[micro_name(summary)]["error"] for state in summary["states"]):
        found.append(
            "- The error on these images is not known: the residual and the ultimate error "
            "bound it from below only. To measure it for a smooth field on your own reference, put "
            f"`virtual: {{strains: [0.02, 0.05], noise: {figure(summary.get('scan_noise'), '.3g')}}}` "
            "into a copy of the configuration (white noise that is as strong once blurred), take "
            "`scans.states` out, and give it a `case` of its own. Such a field suits coarse meshes, "
            "that of struts does not."
        )
    found += [
        f"- The synthetic test is not what it claims to be: {check_words(check)}."
        for check in failed_checks(summary)
    ]
    return found or ["None."]


def strain_warnings(summary: dict) -> list[str]:
    """Lines where the specimen gets longer, or the strain falls from state to state: is it the axis, or
    the order of the scans, that is wrong?"""
    strains = {state["state"]: state["strain"] for state in summary["states"]}
    longer = [number for number, strain in strains.items() if strain < -STRETCHED]
    falls = [n for n in strains if strains[n] < strains.get(n - 1, strains[n]) - STRETCHED]
    found = axis_warnings(summary) + platen_warnings(summary)
    for n in longer[:1]:
        found.append(
            f"- The specimen gets longer, by {-strains[n]:.1%} in state {n} (at most {STRETCHED:.1%} in "
            "a compression): unless it was pulled, loading_axis is another, or scans.reference is not "
            "the scan at rest."
        )
    for n in falls[:1]:
        found.append(
            f"- The strain falls from {strains[n - 1]:.1%} to {strains[n]:.1%} in state {n} (by at most "
            f"{STRETCHED:.1%} under a growing load): unless the specimen was unloaded, scans.states is "
            "not in the order of loading."
        )
    return found


def platen_warnings(summary: dict) -> list[str]:
    """One line where the ends of the finest meso mesh do not go with the platens of the images."""
    for state in summary["states"]:
        platens = state.get("platens")
        if platens and platens["apart"] > APART:
            (low, high), ends = platens["moved"], platens["ends"]
            return [
                f"- In state {state['state']} the platens have moved by {low:+.2f} and {high:+.2f} "
                "voxels, as the images show, the ends of the finest meso mesh by "
                f"{ends[0]:+.2f} and {ends[1]:+.2f} (at most {APART:g} apart): unless the foam does not "
                "touch them, it was lost there. Look at Fig. 6 for the platens and at Fig. 13 for the "
                "ends; states nearer to each other, or a coarser first mesh in meso.sizes, help."
            ]
    return []


def axis_warnings(summary: dict) -> list[str]:
    """One line where the specimen is compressed most along another axis than that of the load."""
    for state in summary["states"]:
        strains = state.get("strain_axes") or {"": state["strain"]}
        most = max(strains, key=strains.get)
        if strains[most] > max(state["strain"], 0) + STRETCHED:
            return [
                f"- In state {state['state']} the specimen is compressed most along {most}, by "
                f"{strains[most]:.1%}, and by {state['strain']:.1%} along the loading axis: unless it "
                f"was squeezed from the side, say `loading_axis: {most}`, or correct scans.axes."
            ]
    return []


def topology_warnings(counts: dict | None, methods: Iterable[str]) -> list[str]:
    """One line when the mesh of the struts has stubs, necks or welds; what the methods make of them."""
    names = {
        "stubs": "dangling stub{s}",
        "necks": "neck{s} thinner than a square voxel",
        "welds": "weld{s} torn by the displacement",
    }
    some = [
        f"{counts[key]} {name.format(s='' if counts[key] == 1 else 's')}"
        for key, name in names.items()
        if counts and counts[key]
    ]
    if not some:
        return []
    gaps = {METHODS[method].gap for method in methods}
    return [
        f"- The mesh of the struts has {', '.join(some)}, of which a foam has none: see the figure of "
        "its topology, and geometry/topology.json for where. "
        f"{' '.join(text for gap, text in STUBS.items() if gap in gaps)} For fewer of them, first lower "
        "images.blur, then mesh.size; a porosity that is too high breaks struts too."
    ]


def state_warnings(state: dict, summary: dict) -> list[str]:
    """What to distrust of one state: first of the default micro method, then the loops of the others."""
    micro = micro_name(summary)
    found = loop_warnings(state, micro) + doubt_warnings(state, micro) + flag_warnings(state)
    if state["verdict"] == "failed":
        found.append(
            f"- State {state['state']} could not be registered: at least half of its nodes "
            "have a residual far above the noise of the images."
        )
    found += fold_warnings(state, summary) + torn_warnings(state, micro)
    found += equilibrium_warnings(state) + unlike_warnings(state, network_name(summary))
    found += residual_warnings(state, micro)
    found += noise_warnings(state, micro)
    others = (name for name in summary["results"] if name != micro)
    return found + [line for name in others for line in loop_warnings(state, name)]


def loop_warnings(state: dict, mesh: str) -> list[str]:
    """One line where the loop of a mesh did not end by its criterion."""
    one = state[mesh]
    if one["converged"] or one["refused"]:
        return []
    remedy = (
        f"It starts from {mesh_name(mesh)}, which may be far off (Fig. 10); nothing else uses it."
        if one["weight"]
        else "Look at the residual maps (Fig. 13); a longer regularisation length or a better start "
        "may help."
    )
    return [
        f"- State {state['state']}, {mesh}: the loop did not end, after {one['iterations']} iterations "
        f"in all (last rms(du) {figure(one['last_step'], '.1e')} voxel). {remedy}"
    ]


def fold_warnings(state: dict, summary: dict) -> list[str]:
    """One line where a displacement turns more than a few elements of a mesh inside out."""
    shares = {mesh: state[mesh].get("inverted") or 0.0 for mesh in summary["results"]}
    folded = [f"{mesh} {share:.1%}" for mesh, share in shares.items() if share > FOLDED]
    if not folded:
        return []
    return [
        f"- State {state['state']}: the displacement turns elements inside out, which no material does: "
        f"{', '.join(folded)} (at most {FOLDED:.0%}). Its strains are not to be used there; on a mesh "
        "of meso DVC (Fig. 10) struts fold more sharply than it can follow, which micro DVC may mend."
    ]


def torn_warnings(state: dict, micro: str) -> list[str]:
    """One line where a state tears bridges: there was no strut."""
    torn = state[micro].get("torn") or []
    if not torn:
        return []
    places = "; ".join(", ".join(f"{x:.0f}" for x in place) for place in torn)
    count = "1 bridge" if len(torn) == 1 else f"{len(torn)} bridges"
    return [
        f"- State {state['state']}, {micro}: {count} of mesh.mend did not hold, at (x, y, z in voxels) "
        f"{places}: the images show two halves that move apart, and the mesh was cut there. The cut, a "
        "layer of cells, has no strain, and its nodes are not judged."
    ]


def doubt_warnings(state: dict, micro: str) -> list[str]:
    """One line where more than a few nodes are in doubt."""
    doubtful = 1 - state[micro]["valid_nodes"]
    if state["verdict"] != "flagged" or doubtful <= 0.05:
        return []
    return [
        f"- State {state['state']}: {doubtful:.1%} of the nodes (at most 5 %) have a residual "
        "far above the noise of the images. Leave them out (`valid` in the fields is 0), and "
        "look at the residual maps (Fig. 13)."
    ]


def flag_warnings(state: dict) -> list[str]:
    """One line where more than a few struts are flagged."""
    struts = state.get("struts") or {"valid": 0, "flagged": 0}
    count = struts["valid"] + struts["flagged"]
    if struts["flagged"] <= 0.1 * count:
        return []
    return [
        f"- State {state['state']}: {struts['flagged']} of {count} struts (at most 10 %) are "
        "flagged: broken by the threshold, not measured, far from equilibrium or on nodes in doubt. "
        "What is said of bending leaves them out; the scene shows where they are."
    ]


def unlike_warnings(state: dict, network: str | None) -> list[str]:
    """One line where struts are measured in equilibrium, which the network fit found no help."""
    weight = (state.get("equilibrium") or {}).get("weight")
    if weight is None or network is None or not state[network]["refused"]:
        return []
    return [
        f"- State {state['state']}: struts are measured in equilibrium, but the images do not show "
        f"that {mesh_name(network)} comes nearer by it ({network} is a copy): where struts hinge, "
        "touch or are moved from outside it takes motion for noise. Compare the columns `_raw` of the "
        "struts, and if they tell another story say `struts: {equilibrium: false}`."
    ]


def equilibrium_warnings(state: dict) -> list[str]:
    """One line where struts should be measured in equilibrium (`struts.equilibrium`) and are not."""
    reason = refusal(state.get("equilibrium") or {})
    if reason is None:
        return []
    return [
        f"- State {state['state']}: struts are as measured, with all the noise (weight of the "
        f"equilibrium null): {reason}. Noise adds to axial strain and stretching: of struts trust "
        "those with a `dominance` that is not undecided, and compare no such state with others."
    ]


def residual_warnings(state: dict, micro: str) -> list[str]:
    """Whether micro DVC leaves far more of the residual than noise explains: some struts are lost."""
    sigma, alone = state[micro]["residual_std"], state.get("noise_std")
    if (
        sigma is None
        or alone is None
        or sigma <= NOISE_TIMES * alone
        or state["verdict"] == "failed"
    ):
        return []
    return [
        f"- State {state['state']}, {micro}: the residual has a standard deviation of "
        f"{grey_words(sigma)} grey levels, {sigma / alone:.1f} times that of noise alone (at most "
        f"{NOISE_TIMES:g}): some struts are not where they were put, or the contrast of the "
        "scans differs. Look at Fig. 13 for where, "
        "leave out what is not `valid`; raise micro.mending, or say images.grey: global."
    ]


def noise_warnings(state: dict, micro: str) -> list[str]:
    """One line where micro DVC follows whatever the images show, noise too."""
    sigma, alone = state[micro]["residual_std"], state.get("noise_std")
    if state[micro].get("shortest_l_e"):
        why = f"its l_E is {state[micro]['l_e']:.2g} voxels, the shortest that may be chosen"
    elif sigma is not None and alone is not None and sigma < alone / NOISE_OVER:
        why = (
            f"its residual, {grey_words(sigma)} grey levels, is far below that of noise alone, "
            f"{grey_words(alone)}"
        )
    else:
        return []
    return [
        f"- State {state['state']}, {micro}: it follows the noise, since {why}. Scans that differ by "
        "more than noise, a start far off, or struts that do not move as elastic ones ask for that. "
        "Believe no strain of single struts; look at Fig. 13, say images.grey: global, or set micro.l_e "
        "to a cell size and compare."
    ]


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
