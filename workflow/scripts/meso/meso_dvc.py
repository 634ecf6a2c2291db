"""Eq. 9: meso DVC on one mesh, from the best start of the coarsest or the best for this one."""

from addvc.correlation.candidates import candidate, mesh_field
from addvc.correlation.meso import chosen_register, meso_options, meso_system
from addvc.correlation.store import load_notes, save_solution
from addvc.fem.io import read_mesh
from addvc.images.files import read_json
from addvc.images.scans_store import load_volume
from addvc.runtime import job

with job(snakemake) as log:
    source, params = snakemake.input, snakemake.params
    mesh = read_mesh(source.mesh)
    size = read_json(source.figures)["mean_edge"]
    options = meso_options(params.meso, size, params.axis, params.coarsest)
    system = meso_system(mesh, load_volume(source.reference)[0], options)
    before = load_notes(source.start)["best"] if params.coarsest else params.coarser
    fields = {before: mesh_field(source.coarser, source.start)}
    fields |= {name: candidate(name, source, params.axis) for name in params.names}
    starts = {name: field(mesh.points) for name, field in fields.items()}
    deformed = load_volume(source.deformed)[0]
    name = snakemake.wildcards.meso
    solution, best, table = chosen_register(system, deformed, starts, options.stop, name)
    log.info("%s starts from %s", name, best)
    save_solution(snakemake.output[0], solution, best=best, candidates=table)
