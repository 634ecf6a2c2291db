"""Beyond the paper: how well the reference, carried by each result, covers the deformed image."""

from addvc.runtime import job
from addvc.report.case import Case
from addvc.report.tables import overlaps

with job(snakemake):
    case = Case.of(snakemake.params.case, snakemake.input)
    overlaps(case, snakemake.output)
