"""Fig. 10: deformed meso meshes and sigma(r)."""

from addvc.report.case import Case
from addvc.report.meso import deformed
from addvc.runtime import job

with job(snakemake):
    case = Case.of(snakemake.params.case, snakemake.input)
    deformed(case, snakemake.output)
