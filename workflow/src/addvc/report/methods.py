"""Methods to paste into a paper, with references, from the configuration and the numbers."""

from collections.abc import Callable

from addvc.config import METHODS, case_kind, chooses, loading_axis, micro_names, scan_settings
from addvc.correlation.micro import MicroOptions, micro_options, turns
from addvc.errors import grey_words
from addvc.report import style
from addvc.report.page_tables import network_name
from addvc.report.references import Citations

STARTS = {
    "zero": "no displacement",
    "platens": "a coarse grid that holds the platens",
    "freeform": "a free-form displacement on cubic B-splines {freeform}",
    "previous": "the displacement of the state before",
    "extrapolated": "that of the state before, scaled by the motion of the platens",
    "composed": "that of the state before, followed by a free-form displacement between the two states",
}


def methods(summary: dict, config: dict, scans: dict) -> list[str]:
    """Paragraphs, then the references, as lines of reStructuredText."""
    cite = Citations()
    parts = [images(summary, config, scans), meso(summary, config), micro(summary, config)]
    parts += [quality(summary), struts(summary, config)]
    lines = []
    for part in filter(None, parts):
        lines += [part.format_map(cite), ""]
    for reference in cite.listed():
        lines += [f"| {reference}"]
    return [*lines, ""]


GREY = {
    "none": "",
    "auto": "brought to the brightness and contrast of the reference where these had clearly drifted, ",
    "global": "brought to the brightness and contrast of the reference, ",
}
"""What was done to the scans before the blur, by `images.grey`."""

MADE = {
    "twin": "are synthetic, of a network of beams in equilibrium (the twin of addvc); they ",
    "virtual": "are the first of them, and this deformed by a known field on the computer; they ",
    "scans": "",
}
"""What scans are that no tomograph made."""


def listing(words: list[str], last: str = "and") -> str:
    """a, b and c."""
    return f" {last} ".join(filter(None, [", ".join(words[:-1]), words[-1]]))


def span(values: list[float], form: str | Callable[[float], str]) -> str:
    """From the least to the greatest of the values, or the one that there is."""
    low, high = (
        form(value) if callable(form) else format(value, form)
        for value in (min(values), max(values))
    )
    return low if low == high else f"{low} to {high}"


def scans_words(summary: dict, config: dict, scans: dict) -> str:
    """How many scans there are, of what size, what was done to it, and who made them."""
    first, factor, size = scans["scans"][0], scans["bin"], summary["voxel_size_um"]
    told = [
        f"The scans ({len(summary['states']) + 1}, of {' x '.join(map(str, first['shape']))} voxels of "
        f"{size / factor:g} micrometres"
    ]
    if scan_settings(config, 0)["crop"]:
        told.append(f"of which {' x '.join(map(str, first['binned_shape']))} were kept in the end")
    if factor > 1:
        told.append(f"binned by {factor} to voxels of {size:g} micrometres")
    return f"{', '.join(told)}) {MADE[case_kind(config)]}were"


def images(summary: dict, config: dict, scans: dict) -> str:
    """What was scanned, and how the images are read."""
    versions, geometry, settings = summary["versions"], config["geometry"], config["images"]
    blur = f"blurred by a Gaussian of {settings['blur']:g} voxel and " if settings["blur"] else ""
    cell = "read from the autocorrelation of the reference, "
    level = f"which leaves a porosity of {summary['porosity']:.3f}, "
    return (
        "Displacement was measured by architecture-driven digital volume correlation {addvc} {addict} "
        f"with addvc {versions['addvc']} (commit {versions['commit']}), a Snakemake workflow "
        f"{{snakemake}}. {scans_words(summary, config, scans)} {GREY[settings['grey']]}{blur}"
        f"evaluated between voxels by B-splines of degree {settings['degree']} "
        "{spline}; lengths are in these voxels. The cell size, "
        f"{cell if geometry['cell_size'] == 'auto' else ''}is {summary['cell_size']:.1f} "
        "voxels; the threshold between void and solid, "
        f"{level if geometry['threshold'] == 'auto' else ''}is "
        f"{grey_words(summary['threshold'])} grey levels."
    )


def meso(summary: dict, config: dict) -> str:
    """Meso DVC and its start."""
    meshes = [m for name, m in summary["meshes"].items() if not name.startswith("micro")]
    edges = listing([f"{mesh['mean_edge']:.1f}" for mesh in meshes])
    starts = listing([STARTS[c] for c in config["meso"]["candidates"]], "or")
    least, more = config["meso"]["clear"], set(config["meso"]["candidates"]) - {"zero", "platens"}
    clear = f", on the voxels whose gradient exceeds {least:g} times its noise" if least else ""
    fields = " or from one of these that is defined everywhere" if more else ""
    used = [state[name]["l_l"] for state in summary["states"] for name in finer(summary)]
    auto = config["meso"]["l_l"] == "auto"
    chosen = ", the length of least unbiased risk {stein} in each state" if auto else ""
    laplacian = f", with a Laplacian below {span(used, '.3g')} voxels{chosen}" if any(used) else ""
    on = f"finer meshes{laplacian}, and micro DVC" if finer(summary) else "micro DVC"
    return (
        "Each loading state was registered with the reference by finite-element DVC {dvc} on "
        f"tetrahedra with a mean edge of {edges} voxels, coarse to fine{clear}, from the start of least "
        f"residual: {starts}, each rescaled in a reduced basis on the coarsest mesh {{addvc}}; "
        f"{on} started from the coarser result{fields}.{equilibrium_fit(summary)}"
    )


def equilibrium_fit(summary: dict) -> str:
    """The network fit, where it was made."""
    name = network_name(summary)
    if name is None or not summary["states"]:
        return ""
    without = [state["label"] for state in summary["states"] if not state[name]["weight"]]
    told = f"{name}; refused in {', '.join(without)}" if without else name
    return (
        " What the finest of these meshes had found was also fitted, robustly {robust}, by motions of "
        "the frame of struts that the reference shows, which hardly need loads between their ends, at "
        f"the weight of least unbiased risk {{stein}} in each state ({told})."
    )


def finer(summary: dict) -> list[str]:
    """The meso meshes but the coarsest."""
    return [name for name in summary["meshes"] if not name.startswith("micro")][1:]


def region_named(region: dict) -> str:
    """A slab of the specimen, in voxels: `micro.region` as it was cut out."""
    axes = [name for n, name in enumerate("xyz") if n != region["axis"]]
    slab = f"{region['low']:.1f} to {region['high']:.1f} voxels along {'xyz'[region['axis']]}"
    if region["radius"] is not None:
        return f"{slab}, within {region['radius']:.1f} of its middle"
    sides = (
        f"{low:.1f} to {high:.1f} along {name}"
        for name, (low, high) in zip(axes, region["bounds"], strict=True)
    )
    return f"{slab}, {', '.join(sides)}"


def mesh_words(summary: dict, config: dict) -> str:
    """The mesh of the struts: of which part of the specimen, how it was made, what was put in."""
    mesh, region = summary["meshes"]["micro"], summary.get("region")
    where = "" if region is None else f" of a part of the specimen ({region_named(region)})"
    by = "" if config["mesh"]["backend"] == "pytetwild" else " by isosurface stuffing {stuffing}"
    bridges = (summary.get("topology") or {}).get("bridges")
    put = (
        f"; {bridges} struts that the threshold broke, but a lower one shows whole, were put "
        "in as rods of the section that the grey level tells, half as stiff as the rest"
        if bridges
        else ""
    )
    return (
        f"The struts{where} were meshed{by} with {mesh['cells']} tetrahedra ({mesh['nodes']} nodes, "
        f"mean volume {mesh['mean_volume']:.3g} voxel^3{put})."
    )


def micro(summary: dict, config: dict) -> str:
    """The mesh of the struts and each method of micro DVC."""
    text = mesh_words(summary, config)
    section = config["micro"]
    options = micro_options(section, summary["cell_size"], loading_axis(config))
    along = style.AXES[loading_axis(config)]
    wave = f"in weights set on a shear wave of period {options.period:g} voxels along {along}"
    for name, method in micro_names(config).items():
        lead = " The displacement of its nodes minimises" if name == "micro" else " For comparison:"
        used = [state[name]["l_e"] for state in summary["states"] if not METHODS[method].gap]
        text += f"{lead} {functional(method, section, options, used)}, {wave} ({method})."
    first = section["methods"][0]
    if section["mending"] and section["stages"] > 1 and not METHODS[first].gap:
        text += (
            " Struts whose residual stayed too large were carried by their neighbours and registered "
            f"again, at most {section['mending']} times."
        )
    return text + (
        f" A loop ended when the rms of an increment fell below {section['tolerance']:g} voxel, "
        f"{endings(summary, first)}."
    )


def functional(method: str, section: dict, options: MicroOptions, cutoffs: list[float]) -> str:
    """What a method of micro DVC minimises; `cutoffs`: l_E of every state (voxels)."""
    parts = METHODS[method]
    if parts.gap:
        return (
            "the squared residual in the struts, regularised by the equilibrium gap {gap} below "
            f"{options.l_k:.3g} voxels, and by a Laplacian below {options.l_l:.3g} voxels on penalised "
            f"faces (Poisson's ratio {options.nu:g})"
        )
    shell = section["shell"] and parts.shell
    robust = section["robust"] != "none" and parts.robust
    return (
        f"the {'robust residual (Geman-McClure weights {robust})' if robust else 'squared residual'} "
        f"in the struts{f' and in the void within {shell:g} voxel of them' if shell else ''}, "
        f"regularised by an elastic energy (Poisson's ratio {options.nu:g})"
        f"{' in a frame that turns with the struts' if turns(section, method) else ''} below "
        f"{span(cutoffs or [options.l_e], '.3g')} voxels{chosen_words(method, section)}"
    )


def chosen_words(method: str, section: dict) -> str:
    """Where the cut-off length came from."""
    if chooses(section, method):
        return ", the length of least unbiased risk {stein} in each state"
    return ""


def endings(summary: dict, method: str) -> str:
    """In which states the loop of the default method ended."""
    if not summary["states"]:
        return "state by state"
    lost = [state["label"] for state in summary["states"] if not state["micro"]["converged"]]
    if lost:
        return f"which that of {method} did not at {listing(lost)}"
    return f"as that of {method} did in every state"


def noise_words(summary: dict) -> str:
    """The standard uncertainty by noise in voxels and micrometres."""
    found = [state["uncertainty"]["rms"] for state in summary["states"]]
    found = [rms for rms in found if rms is not None]
    if not found:
        return ""
    micrometres = [rms * summary["voxel_size_um"] for rms in found]
    return (
        "By the noise of the images the standard uncertainty of the displacement of a node is "
        f"{span(found, '.3f')} voxel ({span(micrometres, '.2g')} micrometres, rms length of the "
        "vector). "
    )


def alone_words(summary: dict) -> str:
    """What noise alone would leave of the residual, where it is known."""
    found = [state.get("noise_std") for state in summary["states"]]
    known = [value for value in found if value is not None]
    if not known:
        return ""
    return f", where the noise of both images alone would leave {span(known, grey_words)}"


def quality(summary: dict) -> str:
    """Residual, ultimate error, validity, and the error where a truth is known."""
    found = [state["micro"] for state in summary["states"]]
    residuals = [one["residual_std"] for one in found if one["residual_std"] is not None]
    if not residuals:
        return ""
    ultimate = summary["meshes"]["micro"]["ultimate_error"]
    valid = span([100 * one["valid_nodes"] for one in found], ".1f")
    text = (
        "The residual in the struts has a standard deviation of "
        f"{span(residuals, grey_words)} grey levels{alone_words(summary)}. "
        f"{noise_words(summary)}Interpolation alone, under a rigid sub-voxel "
        f"shift without noise {{limits}}, gives {ultimate:.1e} voxel. {valid} % of the nodes have a "
        "residual that the noise of the images explains; the others are flagged."
    )
    errors = [one["error"]["median"] for one in found if one["error"]]
    errors = [median for median in errors if median is not None]
    known = f" Against the known truth the median error is {span(errors or [0], '.3f')} voxel."
    return text + (known if errors else "")


def balance_words(summary: dict) -> str:
    """In which states struts were measured in equilibrium."""
    states = [(s["label"], (s.get("equilibrium") or {}).get("weight")) for s in summary["states"]]
    taken = [label for label, weight in states if weight is not None]
    if not taken:
        return "Struts were measured on the displacement as it is, without equilibrium of them. "
    where = "in every state" if len(taken) == len(states) else f"at {listing(taken)} only"
    return (
        "Noise that no frame of elastic struts in equilibrium could follow was taken off the "
        f"displacement {where}, with the weight of the equilibrium by generalised cross-validation "
        "{validation}; it is left as measured where Stein's estimate {stein} has the error grow even if "
        "noise were twice what is expected. "
    )


def struts(summary: dict, config: dict) -> str:
    """How struts and cells were analysed, and what came out."""
    found = [s["struts"] for s in summary["states"] if (s["struts"] or {}).get("bending_share")]
    if not found:
        return ""
    text = balance_words(summary) if config["struts"]["equilibrium"] else ""
    text += (
        "The motion of each strut was fitted by that of a geometrically exact beam; the energy of the "
        f"{span([one['valid'] for one in found], 'd')} valid struts is in bending {{bending}} by "
        f"{span([100 * one['bending_share'] for one in found], '.0f')} %."
    )
    if any(state.get("cells") for state in summary["states"]):
        text += (
            " The strain of a cell is that of the affine displacement that fits the solid in a window "
            "one cell wide best {gradient}."
        )
    return text
