"""Beyond the paper: dangling stubs, necks and welds of the micro mesh, as a picture and as a table."""

from addvc.runtime import job
from addvc.report.case import Case
from addvc.report.tables import write_tables
from addvc.report.topology import marked, topology_rows

with job(snakemake):
    case = Case.of(snakemake.params.case, snakemake.input)
    write_tables(snakemake.output.table, topology_rows(case))
    marked(case, snakemake.output.picture)
