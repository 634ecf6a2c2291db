"""Measured struts against the truth."""

from addvc.runtime import job, told
from addvc.analysis.strut_store import load_partition, read_columns, write_columns
from addvc.analysis.struts_truth import flags, judged, true_columns
from addvc.analysis.truth import load_truth
from addvc.correlation.store import load_field
from addvc.fem.io import read_mesh
from addvc.images.files import write_json

with job(snakemake) as log:
    source, results = snakemake.input, snakemake.params.results
    struts, _ = load_partition(source.struts)
    truth, state = load_truth(source.truth), int(snakemake.wildcards.state)
    points, nu = read_mesh(source.mesh).points, snakemake.params.nu
    true = true_columns(struts, points, truth, source.truth, state, nu)
    table = read_columns(source.table)
    error = load_field(source.solution) - truth.displacement(points, state)
    figures = judged(table, true, results) | {"flags": flags(struts, table["valid"], error)}
    log.info(told(figures))
    write_columns(snakemake.output.table, true)
    write_json(snakemake.output.figures, figures)
