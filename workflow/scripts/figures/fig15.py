"""Fig. 15: displacement and strain in a slice, meso and micro."""

from addvc.runtime import job
from addvc.report.case import Case
from addvc.report.maps import fields

with job(snakemake):
    case = Case.of(snakemake.params.case, snakemake.input)
    fields(case, snakemake.output, snakemake.params.strain)
