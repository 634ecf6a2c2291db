"""Section 4.2.2: the residual of a result at the points of the micro quadrature."""

from addvc.analysis.residuals import residual_on, save_residual
from addvc.correlation.micro import micro_reference
from addvc.correlation.store import load_field
from addvc.fem.io import read_mesh
from addvc.images.files import write_json
from addvc.images.scans import load_volume
from addvc.runtime import job

with job(snakemake) as log:
    source = snakemake.input
    reference = micro_reference(read_mesh(source.mesh), load_volume(source.reference)[0])
    result = residual_on(reference, load_volume(source.deformed)[0], load_field(source.field))
    log.info("%s", result["statistics"])
    write_json(snakemake.output.statistics, result["statistics"])
    save_residual(snakemake.output.arrays, result)
