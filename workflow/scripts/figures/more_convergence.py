"""rms(du) of every iteration."""

from addvc.runtime import job
from addvc.report.case import Case
from addvc.report.curves import convergence

with job(snakemake):
    case = Case.of(snakemake.params.case, snakemake.input)
    convergence(case, snakemake.output, snakemake.params.tolerance)
