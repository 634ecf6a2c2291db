"""Errors against the truth."""

from addvc.runtime import job
from addvc.report.case import Case
from addvc.report.curves import errors

with job(snakemake):
    case = Case.of(snakemake.params.case, snakemake.input)
    errors(case, snakemake.output, snakemake.params.names)
