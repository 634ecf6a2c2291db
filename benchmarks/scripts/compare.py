"""The table of a case: the workflow's results and elastix by its best settings, state by state."""

from pathlib import Path

from benchmark.study import rows_of_study
from benchmark.tables import best_of, with_ratio, write_csv

from addvc.runtime import job
from addvc.images.files import read_json

with job(snakemake):
    given, params = snakemake.input, snakemake.params
    rows = rows_of_study(Path(params.folder), params.states)
    rows += [read_json(path) for path in given.varied]
    runs = [r | read_json(path) for r, path in zip(params.runs, given.peers, strict=True)]
    for tool in dict.fromkeys(run["tool"] for run in runs):
        for state in params.states:
            rows.append(best_of([r for r in runs if (r["tool"], r["state"]) == (tool, state)]))
    rows = sorted(with_ratio(rows, "meso 12"), key=lambda row: row["state"])
    write_csv(snakemake.output.table, rows, params.columns)
    write_csv(snakemake.output.all, runs, [c for c in params.columns if c != "cpu_ratio"])
