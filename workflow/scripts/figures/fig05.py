"""Fig. 5: the meso meshes."""

from addvc.runtime import job
from addvc.report.anatomy import meso_meshes
from addvc.report.case import Case

with job(snakemake):
    case = Case.of(snakemake.params.case, snakemake.input)
    meso_meshes(case, snakemake.output)
