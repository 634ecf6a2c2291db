"""Table 2: parameters of every correlation."""

from addvc.runtime import job
from addvc.report.case import Case
from addvc.report.tables import parameters

with job(snakemake):
    case = Case.of(snakemake.params.case, snakemake.input)
    parameters(case, snakemake.output, snakemake.params.config, snakemake.params.methods)
