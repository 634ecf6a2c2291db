"""Eq. 8: the Gaussian pre-filter. The result holds the B-spline coefficients of Eq. 4."""

from addvc.runtime import job
from addvc.images.grey import grey_levels, matched
from addvc.images.scans import load_volume, save_volume
from addvc.images.spline import gaussian_blur

with job(snakemake):
    source, axis, images = snakemake.input, snakemake.params.axis, snakemake.params.images
    volume, notes = load_volume(source.volume)
    if source.get("reference"):
        wanted = grey_levels(load_volume(source.reference)[0], axis)
        volume = matched(volume, grey_levels(volume, axis), wanted)
    save_volume(
        snakemake.output[0],
        gaussian_blur(volume, images["blur"]),
        {"bin": notes["bin"], "blur": images["blur"], "degree": images["degree"]},
    )
