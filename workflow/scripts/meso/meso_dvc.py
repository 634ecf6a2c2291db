"""Eq. 9: meso DVC on one mesh, from the best start or from the coarser mesh."""

from addvc.correlation.meso import meso_options, meso_system
from addvc.correlation.register import register
from addvc.correlation.store import load_solution, save_solution
from addvc.correlation.transfer import transfer_matrix
from addvc.fem.io import read_mesh
from addvc.images.files import read_json
from addvc.images.scans import load_volume
from addvc.runtime import job

with job(snakemake):
    source, params = snakemake.input, snakemake.params
    mesh = read_mesh(source.mesh)
    size = read_json(source.figures)["mean_edge"]
    options = meso_options(params.meso, size, params.axis, params.coarsest)
    system = meso_system(mesh, load_volume(source.reference)[0], options)
    into, outside = transfer_matrix(read_mesh(source.coarser), mesh.points)
    u = into @ load_solution(source.start)[0].u
    solution = register(
        system, load_volume(source.deformed)[0], u, options.stop, snakemake.wildcards.meso
    )
    save_solution(snakemake.output[0], solution, nodes_outside_coarser=outside)
