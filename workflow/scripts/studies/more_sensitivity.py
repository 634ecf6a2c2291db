"""Beyond the paper: what each parameter of micro DVC does, as a table and as a picture."""

from addvc.runtime import job
from addvc.images.files import read_json
from addvc.report.studies import sensitivity, sensitivity_rows
from addvc.report.tables import write_tables

with job(snakemake):
    found = [read_json(path) for path in snakemake.input]
    write_tables(snakemake.output.table, sensitivity_rows(found))
    sensitivity(found, snakemake.params.label, snakemake.output.pictures)
