"""Fig. 10: deformed meso meshes and sigma(r)."""

from addvc.runtime import job
from addvc.report.case import Case
from addvc.report.meso import deformed

with job(snakemake):
    case = Case.of(snakemake.params.case, snakemake.input)
    deformed(case, snakemake.output)
