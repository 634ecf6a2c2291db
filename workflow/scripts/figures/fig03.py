"""Fig. 3: the segmented foam in every state."""

from addvc.runtime import job
from addvc.report.anatomy import states
from addvc.report.case import Case

with job(snakemake):
    case = Case.of(snakemake.params.case, snakemake.input)
    states(case, snakemake.output)
