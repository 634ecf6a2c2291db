"""Fig. 15: displacement and strain in a slice, meso and micro."""

from addvc.report.case import Case
from addvc.report.maps import fields
from addvc.runtime import job

with job(snakemake):
    case = Case.of(snakemake.params.case, snakemake.input)
    fields(case, snakemake.output)
