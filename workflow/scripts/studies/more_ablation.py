"""Beyond the paper: what each ingredient of micro DVC gives, as a table and as a picture."""

from addvc.runtime import job
from addvc.images.files import read_json
from addvc.report.studies import ablation, ablation_rows
from addvc.report.tables import write_tables

with job(snakemake):
    found = [read_json(path) for path in snakemake.input]
    labels = {int(state): label for state, label in snakemake.params.labels.items()}
    write_tables(snakemake.output.table, ablation_rows(found, labels))
    ablation(found, labels, snakemake.output.pictures)
