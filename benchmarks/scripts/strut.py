"""A pair of images whose struts move each on its own, and its truth."""

from pathlib import Path

from benchmark.pairs import PairOptions, write_pair

from addvc.runtime import job

with job(snakemake):
    write_pair(Path(snakemake.output[0]).parent, PairOptions(**snakemake.params.strut))
