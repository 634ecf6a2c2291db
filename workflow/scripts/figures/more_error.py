"""Errors against the truth, as a picture and as a table."""

from addvc.runtime import job
from addvc.report.case import Case
from addvc.report.curves import errors
from addvc.report.judging import accuracy

with job(snakemake):
    case = Case.of(snakemake.params.case, snakemake.input)
    errors(case, snakemake.output.pictures, snakemake.params.names)
    accuracy(case, snakemake.output.table, snakemake.params.names)
