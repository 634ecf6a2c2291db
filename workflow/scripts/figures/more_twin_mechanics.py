"""Beyond the paper, of the twin: stress, energies and convergence of its mechanics."""

from addvc.runtime import job
from addvc.report.case import Case
from addvc.report.synthetic import mechanics

with job(snakemake):
    case = Case.of(snakemake.params.case, snakemake.input)
    mechanics(case, snakemake.output, snakemake.input.history)
