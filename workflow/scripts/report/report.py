"""The report as one HTML file, by snakemake's own report of all figures."""

from addvc.runtime import job
from addvc.report.build import build_report

with job(snakemake):
    build_report(
        snakemake.output[0],
        snakemake.params.snakefile,
        snakemake.input.config,
        snakemake.input.stylesheet,
        snakemake.params.target,
    )
