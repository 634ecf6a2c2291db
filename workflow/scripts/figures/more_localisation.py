"""Beyond the paper: strain at the scale of a cell, and the bands in which it gathers."""

from addvc.runtime import job
from addvc.report.case import Case
from addvc.report.cells import cell_strains

with job(snakemake):
    case = Case.of(snakemake.params.case, snakemake.input)
    cell_strains(case, snakemake.output, snakemake.params.truth)
