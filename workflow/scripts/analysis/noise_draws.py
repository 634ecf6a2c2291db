"""What the noise of the images does to the displacement of micro DVC."""

from addvc.correlation.micro import micro_reference, shell_of
from addvc.correlation.register import System
from addvc.correlation.store import load_factor, save_field
from addvc.correlation.uncertainty import Noise, fields_of_noise
from addvc.fem.io import read_mesh
from addvc.fem.shell import load_quadrature
from addvc.images.files import read_json
from addvc.images.scans_store import load_volume
from addvc.runtime import job

with job(snakemake):
    source = snakemake.input
    grey = load_volume(source.reference)[0]
    shell = shell_of(snakemake.params.method, load_quadrature(source.shell))
    reference = micro_reference(read_mesh(source.mesh), grey, shell)
    factor, extra, _ = load_factor(source.factor)
    noise = Noise(read_json(source.threshold)["noise"], snakemake.params.blur)
    draws = fields_of_noise(System(reference, extra, factor), grey.shape, noise)
    save_field(snakemake.output[0], draws)
