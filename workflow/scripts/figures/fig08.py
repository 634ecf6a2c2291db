"""Fig. 8: the region of micro DVC and its mesh."""

from addvc.runtime import job
from addvc.report.anatomy import region
from addvc.report.case import Case

with job(snakemake):
    case = Case.of(snakemake.params.case, snakemake.input)
    region(case, snakemake.output)
