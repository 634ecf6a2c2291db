"""Eq. 8: the Gaussian pre-filter. The result holds the B-spline coefficients of Eq. 4."""

from addvc.images.scans import load_volume, save_volume
from addvc.images.spline import gaussian_blur
from addvc.runtime import job

with job(snakemake):
    volume, notes = load_volume(snakemake.input[0])
    sigma = snakemake.params.images["blur"]
    save_volume(
        snakemake.output[0],
        gaussian_blur(volume, sigma),
        notes["voxel_size_um"],
        {"bin": notes["bin"], "blur": sigma},
    )
