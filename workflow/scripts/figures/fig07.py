"""Fig. 7: what the blur does to the surface."""

from addvc.runtime import job
from addvc.report.anatomy import blur
from addvc.report.case import Case

with job(snakemake):
    case = Case.of(snakemake.params.case, snakemake.input)
    blur(case, snakemake.output, snakemake.params.sigma)
