"""Tables beyond the paper, of tests whose truth is known: how hard they are, what was checked."""

from collections.abc import Iterable

from addvc.errors import grey_words
from addvc.report.case import Case
from addvc.report.page_tables import figure
from addvc.report.tables import write_tables


def difficulty(case: Case, outputs: Iterable[str]) -> None:
    """What is left of each state at rest, under the truth, and by the best field of each mesh."""
    states = case.json("analysis/difficulty.json")["states"]
    first = states[0]
    rows = [["Quantity", "Unit", *(case.labels[s["state"]] for s in states)]]
    names = {"rest": "u = 0", "truth": "the truth"}
    for key in first["sigma"]:
        name = names.get(key, f"the best field of {key}")
        values = (grey_words(s["sigma"][key]) for s in states)
        rows.append([f"σ(r) under {name}", "grey level", *values])
    for key in first["beyond"]:
        name = "an affine field" if key == "affine" else f"the best field of {key}"
        values = (f"{s['beyond'][key]:.3f}" for s in states)
        rows.append([f"rms displacement beyond {name}", "voxel", *values])
    for key, name in (("median", "median"), ("p95", "95th percentile")):
        if "rotation" in first:
            values = (f"{s['rotation'][key]:.1f}" for s in states)
            rows.append([f"Rotation of the struts, {name}", "degree", *values])
    write_tables(outputs, rows)


def accuracy(case: Case, outputs: Iterable[str], names: Iterable[str]) -> None:
    """Errors of each result in each state at the nodes, and the shares of junctions within 1, 2 and 4
    voxels, where the truth has any."""
    head = ["State", "Result", "rms, voxel", "normal, voxel", "along, voxel", "95th percentile, voxel",
            "nodes within 1 voxel", "junctions", "within 1 voxel", "2 voxels", "4 voxels"]  # fmt: skip
    rows = [head]
    for state in case.states:
        for name in names:
            error = case.json(f"analysis/error_{name}_state{state}.json")
            found = error.get("junctions") or {}
            lengths = (error[key] for key in ("rms", "rms_normal", "rms_along", "p95"))
            shares = (found.get(f"within_{limit}") for limit in (1, 2, 4))
            rows.append([
                case.labels[state], name, *(figure(x, ".3f") for x in lengths),
                figure(error["within_1_voxel"], ".2%"), found.get("count", "unknown"),
                *(figure(x, ".1%") for x in shares),
            ])  # fmt: skip
    write_tables(outputs, rows)


def twin_check(case: Case, outputs: Iterable[str]) -> None:
    """Every check of the twin with its limits and whether they hold."""
    rows = [["Check", "Value", "Unit", "At least", "At most", "Holds"]]
    for check in case.json("analysis/twin_check.json")["checks"]:
        low, high = ("–" if x is None else f"{x:.4g}" for x in (check["low"], check["high"]))
        holds = "yes" if check["passed"] else "NO"
        value = figure(check["value"], ".4g")
        rows.append([check["name"], value, check["unit"], low, high, holds])
    write_tables(outputs, rows)
