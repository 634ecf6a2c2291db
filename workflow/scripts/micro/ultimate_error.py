"""Table 2: the ultimate error of micro DVC, by sub-voxel shifts."""

from addvc.correlation.micro import micro_reference, shell_of
from addvc.correlation.register import System
from addvc.correlation.store import load_factor
from addvc.correlation.ultimate import ultimate_error
from addvc.fem.io import read_mesh
from addvc.fem.shell import load_quadrature
from addvc.images.files import write_json
from addvc.images.scans import load_volume
from addvc.runtime import job

with job(snakemake):
    source = snakemake.input
    coefficients = load_volume(source.reference)[0]
    shell = shell_of(snakemake.params.method, load_quadrature(source.shell))
    reference = micro_reference(read_mesh(source.mesh), coefficients, shell)
    factor, extra, _ = load_factor(source.factor)
    shifts = snakemake.params.ultimate_error["shifts"]
    system = System(reference, extra, factor)
    write_json(snakemake.output[0], ultimate_error(system, coefficients, shifts))
