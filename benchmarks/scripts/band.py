"""A pair of images that gives way in a band, and its truth."""

from pathlib import Path

from benchmark.band import Band, write_band
from benchmark.pairs import PairOptions

from addvc.runtime import job

with job(snakemake):
    write_band(Path(snakemake.output[0]).parent, PairOptions(), Band(**snakemake.params.band))
