"""Beyond the paper: measured struts against the truth, as a picture and as a table."""

from addvc.runtime import job
from addvc.report.case import Case
from addvc.report.struts_truth import against_truth, truth_rows
from addvc.report.tables import write_tables

with job(snakemake):
    case = Case.of(snakemake.params.case, snakemake.input)
    write_tables(snakemake.output.table, truth_rows(case))
    against_truth(case, snakemake.output.pictures)
