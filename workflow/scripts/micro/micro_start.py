"""The candidate start of micro DVC with the least score, by residual and energy."""

from addvc.runtime import job, told
from addvc.correlation.micro import micro_options, micro_reference, robust_scale
from addvc.correlation.micro_start import best_candidate, judge
from addvc.correlation.store import load_field, save_field
from addvc.fem.io import read_mesh
from addvc.images.files import read_json
from addvc.images.scans_store import load_coefficients

with job(snakemake) as log:
    source, params = snakemake.input, snakemake.params
    cell = read_json(source.cell_size)["cell_size"]
    options = micro_options(params.micro, cell, params.axis)
    scale = robust_scale(params.micro["robust"], read_json(source.threshold))
    grey, degree = load_coefficients(source.reference)
    reference = micro_reference(read_mesh(source.mesh), grey, degree=degree)
    starts = dict(zip(params.names, map(load_field, source.candidates), strict=True))
    deformed = load_coefficients(source.deformed)[0]
    best, table = best_candidate(judge(reference, options, scale), deformed, starts)
    for row in table:
        log.info(told(row))
    log.info("micro DVC starts from %s", best)
    save_field(snakemake.output[0], starts[best], best=best, candidates=table)
