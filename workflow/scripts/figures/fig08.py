"""Fig. 8: the region of micro DVC and its mesh."""

from addvc.report.anatomy import region
from addvc.report.case import Case
from addvc.runtime import job

with job(snakemake):
    case = Case.of(snakemake.params.case, snakemake.input)
    region(case, snakemake.output)
