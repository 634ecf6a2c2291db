"""Tables beyond the paper, of tests whose truth is known: how hard they are, what was checked."""

from collections.abc import Iterable

from addvc.errors import grey_words
from addvc.report.case import Case
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


def twin_check(case: Case, outputs: Iterable[str]) -> None:
    """Every check of the twin with its limits and whether they hold."""
    rows = [["Check", "Value", "Unit", "At least", "At most", "Holds"]]
    for check in case.json("analysis/twin_check.json")["checks"]:
        low, high = ("–" if x is None else f"{x:.4g}" for x in (check["low"], check["high"]))
        holds = "yes" if check["passed"] else "NO"
        rows.append([check["name"], f"{check['value']:.4g}", check["unit"], low, high, holds])
    write_tables(outputs, rows)
