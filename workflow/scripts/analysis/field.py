"""The results of one state as ParaView reads them: displacement, validity, strain, residual."""

from addvc.analysis.fields import result_fields
from addvc.analysis.residuals import load_residual
from addvc.correlation.store import load_field
from addvc.fem.io import read_mesh, write_mesh
from addvc.images.files import read_json
from addvc.runtime import job

with job(snakemake):
    source = snakemake.input
    micro, noise = read_mesh(source.micro), read_json(source.threshold)["noise"]
    for path, solution, residual, result in zip(
        source.meshes, source.solutions, source.residuals, snakemake.output, strict=True
    ):
        mesh = read_mesh(path)
        u, r = load_field(solution), load_residual(residual)
        write_mesh(result, mesh, *result_fields(mesh, u, micro, r, noise))
