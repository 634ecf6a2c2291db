"""A result as ParaView reads it: displacement, validity, strain, residual."""

from addvc.analysis.fields import result_fields
from addvc.analysis.residuals import load_residual
from addvc.correlation.store import load_field
from addvc.fem.io import read_mesh, write_mesh
from addvc.images.files import read_json
from addvc.runtime import job

with job(snakemake):
    source = snakemake.input
    mesh, micro = read_mesh(source.mesh), read_mesh(source.micro)
    noise = read_json(source.threshold)["noise"]
    u = load_field(source.solution)
    points, cells = result_fields(mesh, u, micro, load_residual(source.residual), noise)
    write_mesh(snakemake.output[0], mesh, points, cells)
