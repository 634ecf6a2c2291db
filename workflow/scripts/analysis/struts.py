"""What every strut undergoes in a state: motion, bending, stretching, twist, their energies."""

from addvc.runtime import job, told
from addvc.analysis.balance import micro_fields
from addvc.analysis.noise import turned
from addvc.analysis.strut_store import load_partition, write_columns
from addvc.analysis.strut_table import MESO, Measured, described, foam, strut_table
from addvc.correlation.micro import turns
from addvc.correlation.store import load_field
from addvc.fem.io import read_vtu
from addvc.fem.mesh import Mesh
from addvc.geometry.strut_frame import load_frame
from addvc.images.files import read_json, write_json

with job(snakemake) as log:
    source, nu = snakemake.input, snakemake.params.nu
    struts, _ = load_partition(source.struts)
    points, cells, point, _ = read_vtu(source.field)
    u, draws = point["displacement"], load_field(source.noise)
    if turns(snakemake.params.micro, snakemake.params.method):
        draws = turned(Mesh(points, cells), u, draws)
    held = load_frame(source.frame) if source.frame else None
    fields, balance = micro_fields(held, Measured(points, u, draws), point["valid"], nu)
    fields[MESO] = Measured(points, load_field(source.meso))
    table = strut_table(struts, fields, point["valid"], nu, read_json(source.bridges))
    whole = {name: foam(table, end) for name, end in snakemake.params.results.items()}
    notes = {"foam": whole, "equilibrium": balance}
    write_columns(snakemake.output.table, table)
    write_json(snakemake.output.notes, notes | {"columns": described(list(fields))})
    log.info(told(notes))
