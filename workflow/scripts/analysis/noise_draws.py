"""What the noise of the images does to the displacement of micro DVC."""

from addvc.correlation.micro import micro_reference
from addvc.correlation.noise import noise_draws, noise_volume
from addvc.correlation.store import load_factor, save_field
from addvc.fem.io import read_mesh
from addvc.images.files import read_json
from addvc.images.scans import load_volume
from addvc.runtime import job

with job(snakemake):
    source, blur = snakemake.input, snakemake.params.blur
    grey = load_volume(source.reference)[0]
    std = read_json(source.threshold)["noise"]
    reference, factor = micro_reference(read_mesh(source.mesh), grey), load_factor(source.factor)[0]
    draws = noise_draws(
        reference, factor.solve, lambda rng: noise_volume(grey.shape, std, blur, rng)
    )
    save_field(snakemake.output[0], draws)
