"""Fig. 12: histograms of the residual."""

from addvc.runtime import job
from addvc.report.case import Case
from addvc.report.curves import histograms

with job(snakemake):
    case = Case.of(snakemake.params.case, snakemake.input)
    histograms(case, snakemake.output)
