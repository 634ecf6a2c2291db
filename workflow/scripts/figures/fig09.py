"""Fig. 9: nodes with penalised curvature."""

from addvc.runtime import job
from addvc.report.anatomy import penalised
from addvc.report.case import Case

with job(snakemake):
    case = Case.of(snakemake.params.case, snakemake.input)
    penalised(case, snakemake.output)
