"""Beyond the paper: the struts as a network, by share of bending and by axial strain."""

from addvc.runtime import job
from addvc.report.case import Case
from addvc.report.struts import network

with job(snakemake):
    case = Case.of(snakemake.params.case, snakemake.input)
    network(case, snakemake.output)
