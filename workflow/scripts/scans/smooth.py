"""Eq. 8: the Gaussian pre-filter. The result holds the B-spline coefficients of Eq. 4."""

from addvc.runtime import job
from addvc.images.grey import corrected
from addvc.images.scans import load_volume, save_volume
from addvc.images.spline import gaussian_blur

with job(snakemake):
    source, axis, images = snakemake.input, snakemake.params.axis, snakemake.params.images
    volume, notes = load_volume(source.volume)
    if source.get("reference"):
        volume = corrected(volume, load_volume(source.reference)[0], axis, images["grey"])
    save_volume(
        snakemake.output[0],
        gaussian_blur(volume, images["blur"]),
        {"bin": notes["bin"], "blur": images["blur"], "degree": images["degree"]},
    )
