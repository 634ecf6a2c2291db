"""Fig. 11: displacement of the finest meso mesh."""

from addvc.report.case import Case
from addvc.report.meso import displacement
from addvc.runtime import job

with job(snakemake):
    case = Case.of(snakemake.params.case, snakemake.input)
    displacement(case, snakemake.output)
