"""What one variant of micro DVC found in one state, as a row of figures."""

from addvc.runtime import job, told
from addvc.analysis.residuals import load_residual
from addvc.analysis.variant import settings, variant_figures
from addvc.correlation.micro import micro_options
from addvc.correlation.store import load_solution
from addvc.fem.io import read_vtu
from addvc.fem.mesh import Mesh
from addvc.images.files import read_json, write_json

with job(snakemake) as log:
    source, params = snakemake.input, snakemake.params
    points, cells, classes, _ = read_vtu(source.mesh)
    levels = read_json(source.threshold)
    options = micro_options(params.micro, read_json(source.cell_size)["cell_size"], params.axis)
    row = params.change | {"state": int(snakemake.wildcards.state)}
    row["settings"] = settings(options, levels["threshold"], params.mesh["size"])
    (solution, notes), residual = load_solution(source.solution), load_residual(source.residual)
    row["settings"]["l_e"] = notes.get("l_e", options.l_e)
    mesh, penalised = Mesh(points, cells), classes["penalised"] > 0
    row |= variant_figures(mesh, penalised, options, solution, residual, levels["noise_at_points"])
    figures = read_json(source.figures)
    row["kept"] = figures["kept_fraction"] * figures["voxel_kept_fraction"]
    row["error"] = read_json(source.error) if source.get("error") else None
    log.info(told(row))
    write_json(snakemake.output[0], row)
