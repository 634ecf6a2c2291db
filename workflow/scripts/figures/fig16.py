"""Fig. 16: the reference carried onto the deformed image."""

from addvc.runtime import job
from addvc.report.case import Case
from addvc.report.warp import warped

with job(snakemake):
    case = Case.of(snakemake.params.case, snakemake.input)
    warped(case, snakemake.output)
