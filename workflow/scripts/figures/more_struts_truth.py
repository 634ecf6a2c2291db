"""Beyond the paper: measured struts against the truth, as a picture and as a table."""

from addvc.report.case import Case
from addvc.report.struts_truth import against_truth, truth_rows
from addvc.report.tables import write_table
from addvc.runtime import job

with job(snakemake):
    case = Case.of(snakemake.params.case, snakemake.input)
    rows = truth_rows(case)
    for path in snakemake.output.table:
        write_table(path, rows)
    against_truth(case, snakemake.output.pictures)
