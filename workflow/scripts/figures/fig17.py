"""Fig. 17: close-ups where meso and micro differ most."""

from addvc.runtime import job
from addvc.report.case import Case
from addvc.report.warp import zoom

with job(snakemake):
    case = Case.of(snakemake.params.case, snakemake.input)
    zoom(case, snakemake.output)
