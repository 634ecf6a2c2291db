"""Table 2: the ultimate error of micro DVC, by sub-voxel shifts."""

from addvc.correlation.micro import micro_reference, shell_of
from addvc.correlation.register import System
from addvc.correlation.store import load_factor
from addvc.correlation.ultimate import STOP, ultimate_error
from addvc.correlation.uncertainty import Noise
from addvc.fem.io import read_mesh
from addvc.fem.shell import load_quadrature
from addvc.images.files import read_json, write_json
from addvc.images.scans_store import load_volume
from addvc.runtime import job

with job(snakemake):
    source = snakemake.input
    coefficients = load_volume(source.reference)[0]
    shell = shell_of(snakemake.params.method, load_quadrature(source.shell))
    reference = micro_reference(read_mesh(source.mesh), coefficients, shell)
    factor, extra, _ = load_factor(source.factor)
    shifts = snakemake.params.ultimate_error["shifts"]
    system = System(reference, extra, factor)
    noise = Noise(read_json(source.threshold)["noise"], snakemake.params.images["blur"])
    write_json(snakemake.output[0], ultimate_error(system, coefficients, shifts, STOP, noise))
