"""Fig. 6: the platen grid."""

from addvc.report.case import Case
from addvc.report.slices import platen_grid
from addvc.runtime import job

with job(snakemake):
    case = Case.of(snakemake.params.case, snakemake.input)
    platen_grid(case, snakemake.output)
