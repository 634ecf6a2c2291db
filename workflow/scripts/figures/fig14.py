"""Fig. 14: the local region of Fig. 15 to 17."""

from addvc.runtime import job
from addvc.report.anatomy import local_region
from addvc.report.case import Case

with job(snakemake):
    case = Case.of(snakemake.params.case, snakemake.input)
    local_region(case, snakemake.output)
