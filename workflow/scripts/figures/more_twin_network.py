"""Beyond the paper, of the twin: the network of beams in each state."""

from addvc.runtime import job
from addvc.report.case import Case
from addvc.report.synthetic import network

with job(snakemake):
    case = Case.of(snakemake.params.case, snakemake.input)
    network(case, snakemake.output, snakemake.input.networks)
