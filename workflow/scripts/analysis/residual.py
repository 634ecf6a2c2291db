"""Section 4.2.2: the residuals of one state at the points of the micro quadrature."""

from addvc.runtime import job, told
from addvc.analysis.residuals import residual_on, save_residual
from addvc.correlation.micro import micro_reference
from addvc.correlation.store import load_field
from addvc.fem.io import read_mesh
from addvc.fem.shell import load_quadrature
from addvc.images.files import write_json
from addvc.images.scans_store import load_coefficients

with job(snakemake) as log:
    source, made = snakemake.input, snakemake.output
    grey, degree = load_coefficients(source.reference)
    shell = load_quadrature(source.shell)
    reference = micro_reference(read_mesh(source.mesh), grey, shell, degree)
    deformed = load_coefficients(source.deformed)[0]
    for field, arrays, statistics in zip(source.fields, made.arrays, made.statistics, strict=True):
        result = residual_on(reference, deformed, load_field(field))
        log.info("%s: %s", field, told(result["statistics"]))
        write_json(statistics, result["statistics"])
        save_residual(arrays, result)
