"""Measured struts against the truth."""

from addvc.analysis.strut_store import load_partition, read_columns, write_columns
from addvc.analysis.strut_table import MESO
from addvc.analysis.struts_truth import judged, true_columns
from addvc.analysis.truth import load_truth
from addvc.fem.io import read_mesh
from addvc.images.files import write_json
from addvc.runtime import job

with job(snakemake) as log:
    source, names = snakemake.input, snakemake.params.names
    struts, _ = load_partition(source.struts)
    truth, state = load_truth(source.truth), int(snakemake.wildcards.state)
    points, nu = read_mesh(source.mesh).points, snakemake.params.nu
    true = true_columns(struts, points, truth, source.truth, state, nu)
    results = dict(zip(names, ("", MESO), strict=True))
    figures = judged(read_columns(source.table), true, results)
    log.info("%s", figures)
    write_columns(snakemake.output.table, true)
    write_json(snakemake.output.figures, figures)
