"""Beyond the paper: the ultimate error over sub-voxel shifts."""

from addvc.runtime import job
from addvc.report.case import Case
from addvc.report.ultimate import ultimate

with job(snakemake):
    case = Case.of(snakemake.params.case, snakemake.input)
    ultimate(case, snakemake.output)
