"""Tables 1 and 2 as CSV: the scans, and the parameters of every correlation."""

import csv
import html
import math
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from addvc.analysis.overlap import REST
from addvc.config import METHODS
from addvc.correlation.meso import meso_options
from addvc.correlation.micro import micro_options
from addvc.errors import grey_words
from addvc.images.files import atomic_path
from addvc.report.case import Case
from addvc.report.methods import span

Rows = list[list[str]]
TWIN = {
    "seed": ("Seed of the synthetic test", "–"),
    "noise": ("Noise", "grey level"),
    "psf": ("Blur of the scanner (standard deviation)", "voxel of the scan"),
    "cupping": ("Cupping (relative)", "–"),
    "rings": ("Ring artefacts", "grey level"),
    "drift": ("Drift of brightness (relative)", "–"),
}


STYLE = """<style>
  table { border-collapse: collapse; font: 14px/1.4 sans-serif; margin: 12px; }
  th, td { text-align: left; padding: 4px 12px; border-bottom: 1px solid #ccc; }
  th { position: sticky; top: 0; background: #fff; }
</style>"""


def write_table(path: str | Path, rows: Rows) -> None:
    """CSV in UTF-8 or, by the name, a page (.html); the first row is the header."""
    if Path(path).suffix == ".html":
        with atomic_path(path) as temporary:
            temporary.write_text(page(rows), encoding="utf-8")
        return
    with atomic_path(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerows(rows)


def write_tables(outputs: Iterable[str | Path], rows: Rows) -> None:
    """The same table under each name."""
    for path in outputs:
        write_table(path, rows)


def page(rows: Rows) -> str:
    """A table as a page for a browser."""
    cells = [
        "".join(f"<{tag}>{html.escape(str(cell))}</{tag}>" for cell in row)
        for tag, row in zip(["th", *["td"] * (len(rows) - 1)], rows, strict=True)
    ]
    body = "\n".join(f"<tr>{line}</tr>" for line in cells)
    return f'<!doctype html>\n<meta charset="utf-8">\n{STYLE}\n<table>\n{body}\n</table>\n'


def acquisition(case: Case, outputs: Iterable[str], config: dict) -> None:
    """Table 1: what was scanned and how, as far as files and configuration say."""
    scans = case.json("input.json")
    first, count = scans["scans"][0], len(case.states)
    rows = [
        ["Parameter", "Value", "Unit"],
        ["Source", source(config), "–"],
        ["Number of scans", f"{count + 1} (1 reference + {count} loadings)", "–"],
        ["Definition", times(first["shape"]), "voxel"],
        ["Voxel size", f"{scans['voxel_size_um']:g}", "µm"],
        ["Encoding", str(first["dtype"]), "–"],
        ["Memory size of one scan", f"{memory(first):.4g}", "MB"],
        ["Binning", f"{scans['bin']:g}", "–"],
        ["Definition after binning", times(first["binned_shape"]), "voxel"],
        ["Voxel size after binning", f"{scans['binned_voxel_size_um']:g}", "µm"],
        ["Loading axis", "xyz"[case.specimen.axis], "–"],
    ]
    rows += [
        [name, f"{config['twin'][key]:g}", unit]
        for key, (name, unit) in TWIN.items()
        if key in config.get("twin", {})
    ]
    write_tables(outputs, rows)


def source(config: dict) -> str:
    """Where the images come from."""
    if "twin" in config:
        return "synthetic test"
    return "reference scan, deformed by a known field" if "virtual" in config else "scans"


def memory(scan: dict) -> float:
    """Megabytes of a scan once it is read: the file may be compressed."""
    return math.prod(scan["shape"]) * np.dtype(scan["dtype"]).itemsize / 1e6


def times(shape: Iterable[int]) -> str:
    return " × ".join(str(n) for n in shape)


def parameters(case: Case, outputs: Iterable[str], config: dict, methods: dict[str, str]) -> None:
    """Table 2: size, functional, lengths, error and cost of each mesh, a column a mesh."""
    names = [*case.meso, *case.micro]
    columns = {name: _column(case, name, config, methods) for name in names}
    keys = list(columns[names[0]])
    rows = [["Parameter", *names]]
    rows += [[key, *(columns[name][key] for name in names)] for key in keys]
    write_tables(outputs, rows)


def _column(case: Case, name: str, config: dict, methods: dict[str, str]) -> dict[str, str]:
    """Parameters of one mesh by name, each with its unit."""
    facts, micro = case.mesh_facts(name), name in case.micro
    image = case.json("input.json")["scans"][0]["binned_shape"]
    given = _micro(case, config, name, methods[name]) if micro else _meso(case, name, config)
    shared = {
        "Ultimate error (voxels)": _ultimate(case, name, "ultimate_error"),
        "The same with noise (voxels)": _ultimate(case, name, "with_noise"),
        "Standard uncertainty a priori (voxels)": _ultimate(case, name, "a_priori"),
        "FE type": "4-node tetrahedron (Lagrange)",
        "Nodes": str(facts["nodes"]),
        "Elements": str(facts["cells"]),
        "Mesh geometry": "Fig. 8" if micro else "Fig. 5",
        "Image definition (voxels)": times(image),
        "Sub-voxel evaluation": f"B-spline (Eq. 4), p = {config['images']['degree']}",
        "Gaussian pre-filter, standard deviation (voxels, Eq. 8)": f"{config['images']['blur']:g}",
    }
    edge = {"Mean element length (voxels)": f"{facts['mean_edge']:.2f}"}
    return edge | given | shared | _outcome(case, name)


def _meso(case: Case, name: str, config: dict) -> dict[str, str]:
    """Functional, length and start of a meso mesh."""
    coarsest = name == case.meso[0]
    options = meso_options(config["meso"], case.mesh_facts(name)["mean_edge"], 0, coarsest)
    before = case.meso[max(case.meso.index(name) - 1, 0)]
    return {
        "Matching functional": "Eq. 2" if options.cutoff == 0 else "Eq. 9 with T = L",
        "Regularisation length (voxels)": f"l_L = {span(case.cutoffs(name) or [options.cutoff], '.3g')}",
        "Initialisation": "coarse to fine" if coarsest else _starts(before, config),
    }


def _micro(case: Case, config: dict, name: str, method: str) -> dict[str, str]:
    """Functional, lengths and start of a micro method."""
    options = micro_options(config["micro"], case.cell_size, case.specimen.axis)
    if METHODS[method].gap:
        functional, lengths = "Eq. 10", f"l_K = {options.l_k:.3g}, l_L = {options.l_l:.3g}"
    else:
        chosen = case.cutoffs(name) or [options.l_e]
        functional, lengths = method.replace("_", " "), f"l_E = {span(chosen, '.3g')}"
    return {
        "Matching functional": functional,
        "Regularisation length (voxels)": lengths,
        "Initialisation": _starts(case.finest, config),
    }


def _starts(before: str, config: dict) -> str:
    """The starts that a mesh chooses from: the solution of the one before, and candidates."""
    fields = [name for name in config["meso"]["candidates"] if name not in ("zero", "platens")]
    if not fields:
        return f"solution of {before}"
    return f"solution of {before} or {', '.join(fields)}, by state (more_starts.csv)"


def _ultimate(case: Case, name: str, key: str) -> str:
    value = case.json(f"analysis/ultimate_{name}.json").get(key)
    return "–" if value is None else f"{value:.2e}"


def _outcome(case: Case, name: str) -> dict[str, str]:
    """Iterations, verdict, and sigma(r) on the mesh's own points, a row a state each."""
    rows = {}
    for state in case.states:
        solution = case.solution(name, state)
        label = case.labels[state]
        rows[f"Iterations, {label}"] = str(solution.iterations)
        rows[f"Verdict, {label}"] = case.verdict(name, state)
        rows[f"σ(r) at the points of the mesh, {label} (grey levels)"] = grey_words(
            solution.residual["std"], 3
        )
    return rows


OVERLAP = {
    "dice": ("Overlap of the solids (Dice) (–)", "{:.3f}"),
    "distance_median": ("Distance of the surfaces, median (voxels)", "{:.3f}"),
    "distance_p95": ("Distance of the surfaces, 95th percentile (voxels)", "{:.3f}"),
    "missed": ("Surface of the image that is missed (%)", "{:.1%}"),
    "outside": ("Surface outside of the image (%)", "{:.1%}"),
}


def overlaps(case: Case, outputs: Iterable[str]) -> None:
    """How well each result carries the whole micro mesh onto the deformed image; first the mesh at
    rest on the reference, which is what can be had."""
    found = {n: case.json(f"analysis/warp_state{n}.json") for n in case.states}
    rows = [["State", "Result", *(name for name, _ in OVERLAP.values())]]
    rows.append(["reference", "mesh at rest", *_overlap(found[case.states[0]][REST])])
    for state, results in found.items():
        rows += [
            [case.title(state, name), name, *_overlap(results[name])]
            for name in (case.finest, *case.micro)
        ]
    write_tables(outputs, rows)


def _overlap(found: dict) -> list[str]:
    """The figures of one result, percentages without their sign."""
    values = [(found[key], form) for key, (_, form) in OVERLAP.items()]
    return ["–" if x is None else form.format(x).rstrip("%") for x, form in values]
