"""The unbiased risk of the cut-off lengths that were tried."""

from addvc.runtime import job
from addvc.report.case import Case
from addvc.report.curves import cutoff

with job(snakemake):
    cutoff(Case.of(snakemake.params.case, snakemake.input), snakemake.output)
