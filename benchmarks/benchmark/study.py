"""What a run of the workflow measured on one case, and at what cost: beside it goes the peer."""

import csv
import time
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from addvc import config as settings
from addvc.analysis.truth import Judge, load_truth
from addvc.correlation.corotational import corotational
from addvc.correlation.micro import (
    elastic,
    micro_options,
    micro_reference,
    plan,
    problem_of,
)
from addvc.correlation.store import load_field, load_order
from addvc.errors import AddvcError
from addvc.fem.io import read_mesh, read_vtu
from addvc.fem.shell import load_quadrature
from addvc.images.files import read_json
from addvc.images.scans_store import load_coefficients

RESULTS = {"meso12": "meso 12", "freeform": "free-form", "micro-eq10": "micro, Eq. 10",
           "micro": "micro, corotational"}  # fmt: skip
"""What is compared of a case of the workflow, with its name in tables."""

MESO = ("smooth", "freeform", "start", "best_start", "meso_dvc")
MICRO = (*MESO, "transfer", "field_on_micro", "micro_start")
RULES = {
    "meso12": MESO,
    "freeform": ("smooth", "freeform"),
    "micro": MICRO,
    "micro-eq10": MICRO,
}
"""Rules whose jobs for one state lead to its displacement, all candidate starts among them, to which
micro DVC itself is added. Meshes and factors, made once a reference, are apart: `ONCE`."""

ONCE = ("cell_size", "threshold", "surface", "micro_mesh", "solid", "penalised_nodes", "shell",
        "factor", "meso_mesh", "platen_grid", "specimen")  # fmt: skip


def cpu_seconds(path: Path) -> float:
    """CPU time of one job, from the benchmark file that snakemake wrote."""
    with path.open() as file:
        text = next(csv.DictReader(file, delimiter="\t"))["cpu_time"]
    try:
        return float(text)
    except ValueError:  # "NA": too short to be sampled
        return 0.0


def cost(folder: Path, result: str, state: int) -> float:
    """CPU seconds of all jobs that lead to a result in one state."""
    names = [f"{rule}/*state{state}" for rule in RULES[result]]
    names += [f"micro_dvc/{result}_state{state}"] if result.startswith("micro") else []
    return sum(
        cpu_seconds(path) for name in names for path in folder.glob(f"benchmarks/{name}.tsv")
    )


def targets(case: str, states: Iterable[int]) -> list[str]:
    """What the workflow must make of a case: the errors of all that is compared."""
    return [
        f"results/{case}/analysis/error_{name}_state{state}.json"
        for state in states
        for name in RESULTS
    ]


def truth_of(config: dict) -> Judge:
    """The truth of a case of the workflow, from its whole configuration."""
    if settings.case_kind(config) == "twin":
        return load_truth(Path(settings.twin_folder(settings.twin_parts(config)[0]), "motion.h5"))
    if "truth" not in config:
        raise AddvcError(
            f"case {config['case']} has neither `twin` nor `truth`: give one, errors need it"
        )
    return load_truth(config["truth"])


def bulk_nodes(folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 3) of the micro mesh and where errors are measured (n,) bool: not penalised."""
    points, _, classes, _ = read_vtu(folder / "geometry/micro.vtu")
    return points, classes["penalised"] == 0


def micro_with(folder: Path, config: dict, state: int, changes: dict) -> tuple[np.ndarray, float]:
    """u (n, 3) by the default method with changes to the `micro` section, from the same start, and
    its CPU seconds, assembly included."""
    start = time.process_time()
    micro, levels = config["micro"] | changes, read_json(folder / "geometry/threshold.json")
    cell = read_json(folder / "geometry/cell_size.json")["cell_size"]
    splines = [load_coefficients(folder / f"volumes/smooth{n}.h5") for n in (0, state)]
    images, degree = [grey for grey, _ in splines], splines[0][1]
    reference = micro_reference(
        read_mesh(folder / "geometry/micro.vtu"),
        images[0],
        load_quadrature(folder / "geometry/shell.h5"),
        degree,
    )
    _, _, weights = elastic(reference, micro_options(micro, cell, settings.loading_axis(config)))
    order, _ = load_order(folder / "dvc/micro_factor.h5")
    bridges = read_json(folder / "geometry/bridges.json")
    problem = problem_of(reference, weights, micro["nu"], order, bridges)
    u = load_field(folder / f"dvc/micro_start_state{state}.h5")
    solution, _ = corotational(
        problem, images[1], u, *plan(micro, levels, config["images"]["blur"])
    )
    return solution.u, time.process_time() - start


def rows_of_study(folder: Path, states: Iterable[int]) -> list[dict]:
    """One row for each state and result of the workflow: errors and CPU seconds."""
    return [
        {"state": state, "tool": label, "settings": ""}
        | read_json(folder / f"analysis/error_{name}_state{state}.json")
        | {"cpu_s": cost(folder, name, state)}
        for state in states
        for name, label in RESULTS.items()
    ]
