"""Table 1: the scans."""

from addvc.report.case import Case
from addvc.report.tables import acquisition
from addvc.runtime import job

with job(snakemake):
    case = Case.of(snakemake.params.case, snakemake.input)
    acquisition(case, snakemake.output, snakemake.params.config)
