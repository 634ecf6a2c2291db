"""Micro DVC of a case with another cut-off of its elastic energy: the errors of state 1."""

from pathlib import Path

from benchmark.study import bulk_nodes, micro_with, truth_of

from addvc.analysis.truth import errors_at
from addvc.images.files import read_json, write_json
from addvc.runtime import job

with job(snakemake) as log:
    config = read_json(snakemake.input[0])
    folder, l_e = Path(snakemake.params.folder), float(snakemake.wildcards.l_e)
    u, cpu = micro_with(folder, config, 1, l_e)
    points, bulk = bulk_nodes(folder)
    (found,) = errors_at(truth_of(config), points[bulk], [u[bulk]], 1)
    log.info("%s", found)
    row = {"state": 1, "tool": f"micro, l_E = {l_e:g}", "settings": "", "cpu_s": cpu}
    write_json(snakemake.output[0], row | found)
