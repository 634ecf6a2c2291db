"""A cube of a real scan, its virtual compression, the truth and the configuration of its case."""

from pathlib import Path

from benchmark.bone import BoneOptions, write_bone

from addvc.runtime import job

with job(snakemake):
    options = dict(snakemake.params.bone)
    scan, size = options.pop("scan"), options.pop("voxel_size_um")
    write_bone(scan, Path(snakemake.output[0]).parent, BoneOptions.of(options), float(size))
