"""summary.json: what was measured, how well, at what cost."""

import csv
import platform
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import numpy as np

from addvc import __version__
from addvc.analysis.platens_check import beside
from addvc.analysis.strut_table import RAW
from addvc.analysis.validity import verdict
from addvc.correlation.cutoff import Ladder
from addvc.correlation.network import refusal
from addvc.correlation.store import load_notes, load_solution
from addvc.fem.io import read_vtu
from addvc.images.files import read_json
from addvc.images.spline import gaussian_blur

PACKAGES = (
    "snakemake",
    "numpy",
    "scipy",
    "scikit-image",
    "scikit-sparse",
    "numba",
    "pytetwild",
    "pymeshlab",
    "pymetis",
    "meshio",
    "pyvista",
    "matplotlib",
)


SPEAKING = ("volume", "smooth", "specimen", "cell_size", "threshold", "truth_error")
"""Rules whose warnings the first page does not give in words of its own."""

WARNED = re.compile(r"^\S+ \[([^]]+)\] WARNING: (.+)$", re.MULTILINE)


@dataclass(frozen=True)
class Scope:
    """What there is to sum up: what has a mesh of its own or a method, coarse to fine, the same with the
    network fit where there is one, the method of each micro result, the finest meso mesh, the loading
    axis, `micro.region`, whether there is a truth and a free-form start, the pre-filter (voxels) and the
    binning of scans, rules whose cost does not count, and whose warnings, since they may run before or
    after, or are no part of this configuration."""

    meshes: list[str]
    results: list[str]
    methods: dict[str, str]
    region: str | dict
    finest: str
    axis: int
    truth: bool
    freeform: bool
    blur: float
    bin: int
    apart: list[str]


def summarise(case: str, folder: str | Path, states: dict[int, str], scope: Scope) -> dict:
    """The summary of results/CASE (`folder`) with the labels of its states."""
    folder = Path(folder)
    read = lambda name: read_json(folder / name)  # noqa: E731
    threshold, scans = read("geometry/threshold.json"), read("input.json")
    return {
        "case": case,
        "methods": scope.methods,
        "results": scope.results,
        "region": None if scope.region == "all" else read("geometry/region.json"),
        "cell_size": read("geometry/cell_size.json")["cell_size"],
        "threshold": threshold["threshold"],
        "porosity": threshold["porosity"],
        "noise": threshold["noise"],
        "scan_noise": scan_noise(threshold["noise"], scope.blur, scope.bin),
        "voxel_size_um": scans["binned_voxel_size_um"],
        "meshes": {mesh: mesh_figures(folder, mesh) for mesh in scope.meshes},
        "topology": read("geometry/topology.json")["counts"],
        "states": [
            {"state": state, "label": label} | state_figures(folder, state, scope)
            for state, label in states.items()
        ],
        "said": said(folder / "logs", states, scope.apart),
        "cost": costs(folder / "benchmarks", scope.apart, states, scope.meshes),
        "versions": {"addvc": __version__, "python": platform.python_version()}
        | {name: version(name) for name in PACKAGES},
    }


def said(folder: Path, states: Iterable[int], apart: Sequence[str]) -> list[str]:
    """What jobs of the rules SPEAKING have warned of, as their logs have it: "smooth 2: ..."; not what
    earlier configurations have left, of other states or of rules `apart`."""
    known = {"all", *(f"state{state}" for state in (0, *states))}
    found = []
    for rule in (rule for rule in SPEAKING if rule not in apart):
        for path in sorted(folder.glob(f"{rule}/*.log")):
            if path.stem in known:
                found += WARNED.findall(path.read_text())
    return [f"{name}: {words}" for name, words in found]


def scan_noise(std: float, blur: float, factor: int) -> float:
    """Standard deviation of the white noise of a scan (grey levels) that is `std` once the scan is
    binned by `factor` and blurred by `blur` (voxels)."""
    impulse = np.zeros((33, 33, 33), np.float32)
    impulse[16, 16, 16] = 1
    return float(std / np.linalg.norm(gaussian_blur(impulse, blur)) * factor**1.5)


def twin_checks(path: str | Path | None) -> dict | None:
    """How many checks of the twin there were, and those that failed; None for other images."""
    if path is None:
        return None
    checks = read_json(path)["checks"]
    return {"count": len(checks), "failed": [check for check in checks if not check["passed"]]}


def mesh_figures(folder: Path, mesh: str) -> dict:
    """Figures of a mesh with its ultimate error (voxels); every micro method shares one mesh."""
    name = "micro" if mesh.startswith("micro") else mesh
    figures = read_json(folder / f"geometry/{name}.json")
    error = read_json(folder / f"analysis/ultimate_{mesh}.json")
    return figures | {
        "ultimate_error": error["ultimate_error"],
        "ultimate_converged": error["converged"],
    }


def state_figures(folder: Path, state: int, scope: Scope) -> dict:
    """Verdict, figures of each mesh, and strain between the valid nodes of the finest meso mesh,
    along the loading axis and each other one; the platens beside its ends."""
    micro, axis = next(mesh for mesh in scope.meshes if mesh.startswith("micro")), scope.axis
    result = {mesh: result_figures(folder, mesh, state, scope.truth) for mesh in scope.results}
    points, _, point, _ = read_vtu(folder / f"fields/{scope.finest}_state{state}.vtu")
    trusted = point["valid"] > 0 if point["valid"].mean() > 0.5 else slice(None)
    along = [(points[trusted, d], point["displacement"][trusted, d]) for d in range(3)]
    strains = [compression(*one) for one in along]
    faces = read_json(folder / "analysis/platens.json")[str(state)]
    best = result[micro]
    _, notes = load_solution(folder / f"dvc/start_state{state}.h5")
    micro_notes = load_notes(folder / f"dvc/micro_start_state{state}.h5")
    struts = read_json(folder / f"struts_state{state}.json")
    return result | {
        "strain": strains[axis],
        "strain_axes": dict(zip("xyz", strains, strict=True)),
        "platens": beside(faces, *along[axis]),
        "start": notes["best"],
        "candidates": notes["candidates"],
        "micro_start": micro_notes["best"],
        "micro_candidates": micro_notes["candidates"],
        "freeform": freeform_figures(folder, state, scope.truth) if scope.freeform else None,
        "verdict": verdict(best["converged"], best["valid_nodes"]),
        "struts": struts["foam"][micro] | raw_share(struts["foam"], micro),
        "equilibrium": struts["equilibrium"],
        "uncertainty": read_json(folder / f"analysis/uncertainty_state{state}.json"),
        "warp": read_json(folder / f"analysis/warp_state{state}.json"),
        "cells": read_json(folder / f"cells_state{state}.json")["localisation"],
        "noise_std": read_json(folder / "analysis/image_noise.json")[str(state)],
    }


def raw_share(foam: dict, micro: str) -> dict:
    """The share of bending of the displacement as measured, where it is not that of the struts."""
    raw = foam.get(micro + RAW)
    return {} if raw is None else {"bending_share_raw": raw["bending_share"]}


def result_figures(folder: Path, mesh: str, state: int, truth: bool) -> dict:
    """Convergence, residual, validity, share of elements turned inside out and, with a truth, the error
    of one mesh in one state."""
    name = f"{mesh}_state{state}"
    solution, notes = load_solution(folder / f"dvc/{name}.h5")
    residual = read_json(folder / f"analysis/residual_{name}.json")
    _, _, point, _ = read_vtu(folder / f"fields/{name}.vtu")
    return {
        "inverted": notes["inverted"],
        "start": notes.get("best"),
        "l_e": notes.get("l_e"),
        "shortest_l_e": is_shortest(notes.get("risk", [])),
        "torn": notes.get("torn", []),
        "l_l": notes.get("l_l"),
        "weight": notes.get("weight"),
        "refused": refusal(notes),
        "converged": solution.converged,
        "iterations": solution.iterations,
        "last_step": solution.history[-1],
        "residual_std": residual["std"],
        "residual_mean": residual["mean"],
        "valid_nodes": float(point["valid"].mean()),
        "seconds": solution.seconds,
        "error": read_json(folder / f"analysis/error_{name}.json") if truth else None,
    }


def is_shortest(trials: list[dict]) -> bool:
    """Whether the least risk of the trials of l_E is on the shortest rung of the ladder."""
    return bool(trials) and min(trials, key=lambda t: t["risk"])["rung"] == Ladder.shortest


def freeform_figures(folder: Path, state: int, truth: bool) -> dict:
    """Convergence and, with a truth, the error of the free-form start."""
    solution, notes = load_solution(folder / f"dvc/freeform_state{state}.h5")
    error = folder / f"analysis/error_freeform_state{state}.json"
    return {
        "converged": solution.converged,
        "iterations": solution.iterations,
        "last_step": solution.history[-1],
        "levels": notes["levels"],
        "seconds": solution.seconds,
        "error": read_json(error) if truth else None,
    }


def compression(position: np.ndarray, displacement: np.ndarray) -> float:
    """Overall compression: by how much the two end faces (a twentieth of the height) come nearer,
    over their distance; coordinates (n,) along one axis, voxels."""
    low, high = position.min(), position.max()
    near = 0.05 * (high - low)
    bottom, top = position <= low + near, position >= high - near
    closer = np.median(displacement[bottom]) - np.median(displacement[top])
    return float(closer / (np.median(position[top]) - np.median(position[bottom])))


def costs(folder: Path, apart: Sequence[str], states: Iterable[int], meshes: Sequence[str]) -> dict:
    """CPU seconds, wall seconds and peak memory of each rule, over its jobs, from benchmarks.

    Figures and the rules `apart` are left out, since they may run while this is read, and what earlier
    configurations have left: benchmarks of other states and meshes."""
    result: dict[str, dict] = {}
    wanted = {"0", *map(str, states)}
    for path in sorted(set(folder.rglob("*.tsv")) - set(folder.glob("figures/*"))):
        with path.open() as file:
            row = next(csv.DictReader(file, delimiter="\t"), None)
        if row is None:  # of a job that is ending just now
            continue
        number = {key: _number(row.get(key)) for key in ("cpu_time", "s", "max_rss")}
        rule = path.relative_to(folder).parts[0]
        named = re.fullmatch(r"(meso\d[^_]*|micro(?:-.*?)?)(?:_state\d+)?", path.stem)
        numbers = re.findall(r"state(\d+)", path.stem)
        if rule in apart or not wanted.issuperset(numbers) or (named and named[1] not in meshes):
            continue
        entry = result.setdefault(rule, {"jobs": 0, "cpu_s": 0.0, "wall_s": 0.0, "max_rss_mb": 0.0})
        entry["jobs"] += 1
        entry["cpu_s"] += number["cpu_time"]
        entry["wall_s"] += number["s"]
        entry["max_rss_mb"] = max(entry["max_rss_mb"], number["max_rss"])
    return result


def _number(text: str | None) -> float:
    """A figure of a benchmark; "NA" where the job was too short to be sampled."""
    try:
        return float(text or 0)
    except ValueError:
        return 0.0
