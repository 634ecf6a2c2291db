"""Fig. 4: the cell size and a slice."""

from addvc.runtime import job
from addvc.report.case import Case
from addvc.report.curves import cell_size

with job(snakemake):
    case = Case.of(snakemake.params.case, snakemake.input)
    cell_size(case, snakemake.output)
