"""The figures of README.md, from the summary of the default case.

`python -m addvc.readme README.md results/twin/summary.json results/benchmarks/peers_2417.csv` puts each
table between its marks, `<!-- table NAME -->` and `<!-- end -->`; the last file, of the benchmarks, may
be left out, and so are the rows of other tools then.
"""

import csv
import re
import sys
from collections.abc import Sequence
from pathlib import Path

from addvc.errors import AddvcError
from addvc.images.files import atomic_path, read_json

TWIN = ("twin_foam", "twin_mechanics", "twin_scan")
GEOMETRY = ("check_input", "volume", "smooth", "specimen", "cell_size", "threshold", "solid", "surface",
            "micro_mesh", "meso_mesh", "platen_grid", "penalised_nodes", "shell",
            "strut_frame")  # fmt: skip
MESO = ("start", "freeform", "freeform_step", "best_start", "meso_dvc")
NETWORK = ("network", "transfer_network")
MICRO = ("transfer", "field_on_micro", "micro_start", "factor", "micro_dvc")
STAGES = {
    "twin and its scans": TWIN,
    "scans, geometry, meshes": GEOMETRY,
    "free-form and meso DVC": MESO,
    "network fit": NETWORK,
    "micro DVC, both methods": MICRO,
}
REST = "all else but figures"

PEER = "elastix"


def table(rows: Sequence[Sequence[str]]) -> str:
    """Rows as markdown, the first one its head."""
    lines = [rows[0], ["---"] * len(rows[0]), *rows[1:]]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def accuracy(summary: dict, peers: Sequence[dict] = ()) -> str:
    """rms and 95th percentile of the error of each result and state, voxels; `peers`: rows of the
    benchmarks (state, tool, rms, p95), of which other tools than addvc's are taken."""
    states = summary["states"]
    head = ["Error, voxels: rms / 95th percentile", *(state["label"] for state in states)]
    body = [
        [f"`{name}`", *(error_words(state[name]) for state in states)]
        for name in summary["results"]
    ]
    return table([head, *body, *peer_rows(peers, [state["state"] for state in states])])


def peer_rows(peers: Sequence[dict], states: Sequence[int]) -> list[list[str]]:
    """A row for each tool that is not addvc's, a column for each state; "–" where it was not run."""
    found = {(row["tool"], int(row["state"])): f"{row['rms']} / {row['p95']}" for row in peers}
    tools = dict.fromkeys(row["tool"] for row in peers if row["tool"].startswith(PEER))
    return [[tool, *(found.get((tool, state), "–") for state in states)] for tool in tools]


def error_words(result: dict) -> str:
    """One result in one state; "–" where no truth is known."""
    error = result["error"]
    words = f"{error['rms']:.3f} / {error['p95']:.3f}" if error else "–"
    return words if result["converged"] else f"{words}, not converged"


def cost(summary: dict) -> str:
    """CPU time and memory of each stage."""
    known = {rule for rules in STAGES.values() for rule in rules}
    stages = STAGES | {REST: tuple(rule for rule in summary["cost"] if rule not in known)}
    rows = [["Stage", "CPU time, s", "Memory of its largest job, MB"]]
    for stage, rules in stages.items():
        jobs = [summary["cost"][rule] for rule in rules if rule in summary["cost"]]
        if jobs:
            seconds = sum(job["cpu_s"] for job in jobs)
            rows.append([stage, f"{seconds:.0f}", f"{max(job['max_rss_mb'] for job in jobs):.0f}"])
    return table(rows)


def filled(text: str, tables: dict[str, str]) -> str:
    """The text with each table between its marks. Raises AddvcError where the marks are missing."""
    for name, body in tables.items():
        marks = re.compile(rf"(<!-- table {re.escape(name)} -->\n).*?(<!-- end -->)", re.S)
        if not marks.search(text):
            raise AddvcError(f"no mark `<!-- table {name} -->` with its `<!-- end -->`; add both")
        text = marks.sub(lambda found, body=body: f"{found[1]}\n{body}\n\n{found[2]}", text)
    return text


def write_filled(readme: str | Path, tables: dict[str, str]) -> None:
    """A file with its tables filled, in its place."""
    text = filled(Path(readme).read_text(), tables)
    with atomic_path(readme) as temporary:
        temporary.write_text(text)


def main(readme: str, summary: str, peers: str | None = None) -> None:
    """Fill README.md."""
    figures, rows = read_json(summary), []
    if peers is not None:
        with Path(peers).open(newline="") as file:
            rows = list(csv.DictReader(file))
    write_filled(readme, {"accuracy": accuracy(figures, rows), "cost": cost(figures)})


if __name__ == "__main__":
    main(*sys.argv[1:])
