"""Beyond the paper: the standard uncertainty of each node from the noise of the images."""

from addvc.runtime import job
from addvc.report.case import Case
from addvc.report.uncertainty import uncertainty

with job(snakemake):
    case = Case.of(snakemake.params.case, snakemake.input)
    uncertainty(case, snakemake.output, snakemake.params.truth)
