"""The errors of one state against the known truth, at bulk nodes of the micro mesh."""

from addvc.runtime import job
from addvc.analysis.truth import errors_at, load_truth
from addvc.correlation.store import load_field
from addvc.fem.io import read_vtu
from addvc.images.files import write_json

with job(snakemake) as log:
    points, _, classes, _ = read_vtu(snakemake.input.mesh)
    bulk = classes["penalised"] == 0
    fields = (load_field(path)[bulk] for path in snakemake.input.fields)
    state = int(snakemake.wildcards.state)
    found = errors_at(load_truth(snakemake.input.truth), points[bulk], fields, state)
    for path, result in zip(snakemake.output, found, strict=True):
        log.info("%s: %s", path, result)
        write_json(path, result)
