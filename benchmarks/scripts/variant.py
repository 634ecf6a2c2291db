"""Micro DVC of a case with other keys of its `micro` section: the errors of state 1."""

from pathlib import Path

from benchmark.study import bulk_nodes, micro_with, truth_of

from addvc.runtime import job
from addvc.analysis.truth import errors_at
from addvc.images.files import read_json, write_json

with job(snakemake) as log:
    config, changes = read_json(snakemake.input[0]), snakemake.params.changes
    folder = Path(snakemake.params.folder)
    u, cpu = micro_with(folder, config, 1, changes)
    points, bulk = bulk_nodes(folder)
    (found,) = errors_at(truth_of(config), points[bulk], [u[bulk]], 1)
    log.info("%s", found)
    told = ", ".join(f"{key} {value}" for key, value in changes.items())
    row = {"state": 1, "tool": "micro, corotational", "settings": told, "cpu_s": cpu}
    write_json(snakemake.output[0], row | found)
