"""Beyond the paper: how hard the test is, as a table."""

from addvc.runtime import job
from addvc.report.case import Case
from addvc.report.judging import difficulty

with job(snakemake):
    case = Case.of(snakemake.params.case, snakemake.input)
    difficulty(case, snakemake.output)
