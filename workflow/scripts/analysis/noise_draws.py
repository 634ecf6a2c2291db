"""What the noise of the images does to the displacement of micro DVC in one state."""

from addvc.runtime import job
from addvc.correlation.micro import micro_reference, shell_of, system_at_rest
from addvc.correlation.store import save_field
from addvc.correlation.uncertainty import Noise, fields_of_noise
from addvc.fem.io import read_mesh
from addvc.fem.shell import load_quadrature
from addvc.images.files import read_json
from addvc.images.scans_store import load_coefficients

with job(snakemake):
    source, params = snakemake.input, snakemake.params
    grey, degree = load_coefficients(source.reference)
    shell = shell_of(params.method, load_quadrature(source.shell))
    reference = micro_reference(read_mesh(source.mesh), grey, shell, degree)
    given = source.factor, source.solution, read_json(source.bridges)
    system = system_at_rest(reference, params.method, params.nu, *given)
    noise = Noise(read_json(source.threshold)["noise"], params.blur)
    draws = fields_of_noise(system, grey.shape, noise)
    save_field(snakemake.output[0], draws)
