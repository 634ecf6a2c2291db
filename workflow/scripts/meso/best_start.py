"""The candidate with the least residual after Eq. 6, 7 and a short correlation on the coarsest mesh."""

import numpy as np

from addvc.runtime import job
from addvc.correlation.candidates import candidate
from addvc.correlation.meso import meso_options, meso_system
from addvc.correlation.meso_start import scaled_start
from addvc.correlation.store import load_field, save_solution
from addvc.correlation.transfer import lattice_matrix
from addvc.fem.io import read_mesh
from addvc.images.files import read_json
from addvc.images.scans_store import load_coefficients

with job(snakemake):
    source, params = snakemake.input, snakemake.params
    mesh = read_mesh(source.mesh)
    size = read_json(source.figures)["mean_edge"]
    reference, degree = load_coefficients(source.reference)
    options = meso_options(params.meso, size, params.axis, coarsest=True, degree=degree)
    system = meso_system(mesh, reference, options)
    starts = {name: candidate(name, source, params.axis)(mesh.points) for name in params.names}
    if "zero" in params.candidates:
        starts["zero"] = load_field(source.zero)
    if "platens" in params.candidates:
        lines = [np.array(line) for line in read_json(source.lines)["lines"]]
        into = lattice_matrix(lines, read_mesh(source.grid), mesh.points)
        starts["platens"] = into @ load_field(source.platens)
    best, solution, table = scaled_start(system, load_coefficients(source.deformed)[0], starts)
    save_solution(snakemake.output[0], solution, best=best, candidates=table)
