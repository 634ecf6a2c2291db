"""Fig. 11: displacement of the finest meso mesh."""

from addvc.runtime import job
from addvc.report.case import Case
from addvc.report.meso import displacement

with job(snakemake):
    case = Case.of(snakemake.params.case, snakemake.input)
    displacement(case, snakemake.output)
