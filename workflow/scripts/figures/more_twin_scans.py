"""Beyond the paper, of the twin: the scans as they are."""

from addvc.runtime import job
from addvc.report.case import Case
from addvc.report.synthetic import scans

with job(snakemake):
    case = Case.of(snakemake.params.case, snakemake.input)
    scans(case, snakemake.output)
