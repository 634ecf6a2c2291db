"""The candidate with the least residual after a short correlation on the coarsest mesh."""

from addvc.correlation.meso import best_start, meso_options, meso_system
from addvc.correlation.store import load_solution, save_solution
from addvc.fem.io import read_mesh
from addvc.images.files import read_json
from addvc.images.scans import load_volume
from addvc.runtime import job

with job(snakemake) as log:
    source, params = snakemake.input, snakemake.params
    size = read_json(source.figures)["mean_edge"]
    options = meso_options(params.meso, size, params.axis, coarsest=True)
    system = meso_system(read_mesh(source.mesh), load_volume(source.reference)[0], options)
    tried = {
        name: load_solution(path)
        for name, path in zip(params.names, source.candidates, strict=True)
    }
    starts = {name: solution.u for name, (solution, _) in tried.items()}
    best, solution, table = best_start(system, load_volume(source.deformed)[0], starts)
    for row in table:
        row["factors"] = tried[row["candidate"]][1]["factors"]
    log.info("best start: %s", best)
    save_solution(snakemake.output[0], solution, best=best, candidates=table)
