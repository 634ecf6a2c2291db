"""Fig. 13: residual on the struts."""

from addvc.runtime import job
from addvc.report.case import Case
from addvc.report.maps import residual_maps

with job(snakemake):
    case = Case.of(snakemake.params.case, snakemake.input)
    residual_maps(case, snakemake.output)
