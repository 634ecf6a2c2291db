"""The tables of README.md, from those in results/benchmarks."""

from benchmark.tables import fill

from addvc.runtime import job

with job(snakemake):
    fill(snakemake.params.readme, snakemake.input)
    open(snakemake.output[0], "w").close()
