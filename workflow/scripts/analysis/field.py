"""The results of one state as ParaView reads them: displacement, validity, strain, residual."""

from addvc.runtime import job
from addvc.analysis.fields import result_fields
from addvc.analysis.noise import load_uncertainty
from addvc.analysis.residuals import load_residual
from addvc.correlation.store import load_field, load_notes
from addvc.fem.io import read_mesh, write_mesh
from addvc.images.files import read_json

with job(snakemake):
    source = snakemake.input
    micro, noise = read_mesh(source.micro), read_json(source.threshold)["noise_at_points"]
    names, each = snakemake.params.names, (source.meshes, source.solutions, source.residuals)
    for name, path, solution, residual, result in zip(names, *each, snakemake.output, strict=True):
        mesh = read_mesh(path)
        u, r = load_field(solution), load_residual(residual)
        torn = load_notes(solution).get("torn_cells", [])
        finite = snakemake.params.strain == "green_lagrange"
        on_points, on_cells = result_fields(mesh, u, micro, r, noise, torn, finite)
        if name == snakemake.params.uncertain:
            on_points["uncertainty"] = load_uncertainty(source.uncertainty)[0]
        write_mesh(result, mesh, on_points, on_cells)
