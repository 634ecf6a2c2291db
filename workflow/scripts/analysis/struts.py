"""What every strut undergoes in a state: motion, bending, stretching, twist, their energies."""

from addvc.analysis.noise import turned
from addvc.analysis.strut_store import load_partition, write_columns
from addvc.analysis.strut_table import MESO, Measured, described, foam, strut_table
from addvc.correlation.micro import turns
from addvc.correlation.store import load_field
from addvc.fem.io import read_vtu
from addvc.fem.mesh import Mesh
from addvc.images.files import write_json
from addvc.runtime import job

with job(snakemake) as log:
    source = snakemake.input
    struts, _ = load_partition(source.struts)
    points, cells, point, _ = read_vtu(source.field)
    u, draws = point["displacement"], load_field(source.noise)
    if turns(snakemake.params.micro, snakemake.params.method):
        draws = turned(Mesh(points, cells), u, draws)
    micro = Measured(points, u, draws)
    fields = {"": micro, MESO: Measured(points, load_field(source.meso))}
    table = strut_table(struts, fields, point["valid"], snakemake.params.nu)
    whole = {
        name: foam(table, suffix)
        for name, suffix in zip(snakemake.params.names, fields, strict=True)
    }
    log.info("%s", whole)
    write_columns(snakemake.output.table, table)
    notes = {"foam": whole, "columns": described(list(fields))}
    write_json(snakemake.output.notes, notes)
