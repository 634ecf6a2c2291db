"""Fig. 6: the platen grid."""

from addvc.runtime import job
from addvc.report.case import Case
from addvc.report.slices import platen_grid

with job(snakemake):
    case = Case.of(snakemake.params.case, snakemake.input)
    platen_grid(case, snakemake.output)
