"""Beyond the paper: what was checked of the twin, as a table."""

from addvc.runtime import job
from addvc.report.case import Case
from addvc.report.judging import twin_check

with job(snakemake):
    case = Case.of(snakemake.params.case, snakemake.input)
    twin_check(case, snakemake.output)
