"""Beyond the paper: bending and stretching in the energy of the struts."""

from addvc.runtime import job
from addvc.report.case import Case
from addvc.report.struts import bending

with job(snakemake):
    case = Case.of(snakemake.params.case, snakemake.input)
    bending(case, snakemake.output, snakemake.params.truth)
