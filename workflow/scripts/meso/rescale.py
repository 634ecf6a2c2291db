"""Eq. 6, 7: a candidate start on the coarsest mesh, rescaled along x, y and z."""

import numpy as np

from addvc.correlation.meso import coarse_reference, rescale
from addvc.correlation.register import Stop
from addvc.correlation.store import load_field, save_solution
from addvc.correlation.transfer import lattice_matrix
from addvc.fem.io import read_mesh
from addvc.images.files import read_json
from addvc.images.scans import load_volume
from addvc.runtime import job

with job(snakemake):
    source = snakemake.input
    mesh, w = read_mesh(source.mesh), load_field(source.start)
    if snakemake.wildcards.candidate == "platens":
        lines = [np.array(line) for line in read_json(source.lines)["lines"]]
        w = lattice_matrix(lines, read_mesh(source.grid), mesh.points) @ w
    reference = coarse_reference(mesh, load_volume(source.reference)[0])
    deformed = load_volume(source.deformed)[0]
    solution, factors = rescale(reference, deformed, w, Stop(1e-3, 10))
    save_solution(snakemake.output[0], solution, factors=factors)
