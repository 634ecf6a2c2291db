"""Beyond the paper: the candidate starts of every state, as a table."""

from addvc.runtime import job
from addvc.report.case import Case
from addvc.report.starts import starts

with job(snakemake):
    case = Case.of(snakemake.params.case, snakemake.input)
    starts(case, snakemake.output)
