"""Table 2: the ultimate error of micro DVC, by sub-voxel shifts."""

from addvc.runtime import job
from addvc.correlation.micro import micro_reference, shell_of, system_at_rest
from addvc.correlation.ultimate import STOP, ultimate_error
from addvc.correlation.uncertainty import Noise
from addvc.fem.io import read_mesh
from addvc.fem.shell import load_quadrature
from addvc.images.files import read_json, write_json
from addvc.images.scans_store import load_coefficients

with job(snakemake):
    source, params = snakemake.input, snakemake.params
    coefficients, degree = load_coefficients(source.reference)
    shell = shell_of(params.method, load_quadrature(source.shell))
    reference = micro_reference(read_mesh(source.mesh), coefficients, shell, degree)
    given = source.factor, source.get("solution"), read_json(source.bridges)
    system = system_at_rest(reference, params.method, params.nu, *given)
    noise = Noise(read_json(source.threshold)["noise"], params.images["blur"])
    shifts = params.ultimate_error["shifts"]
    write_json(snakemake.output[0], ultimate_error(system, coefficients, shifts, STOP, noise))
