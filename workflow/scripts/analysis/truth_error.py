"""The error of a result against the known truth, at bulk nodes of the micro mesh."""

from addvc.analysis.truth import error_at, load_truth
from addvc.correlation.store import load_field
from addvc.fem.io import read_vtu
from addvc.images.files import write_json
from addvc.runtime import job

with job(snakemake) as log:
    points, _, classes, _ = read_vtu(snakemake.input.mesh)
    bulk = classes["penalised"] == 0
    u = load_field(snakemake.input.field)[bulk]
    state = int(snakemake.wildcards.state)
    result = error_at(load_truth(snakemake.input.truth), points[bulk], u, state)
    log.info("%s", result)
    write_json(snakemake.output[0], result)
