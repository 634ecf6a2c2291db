"""Table 1: the scans."""

from addvc.runtime import job
from addvc.report.case import Case
from addvc.report.tables import acquisition

with job(snakemake):
    case = Case.of(snakemake.params.case, snakemake.input)
    acquisition(case, snakemake.output, snakemake.params.config)
