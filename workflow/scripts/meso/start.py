"""A candidate start: the pyramid, on the coarsest mesh (zero) or on the platen grid (platens)."""

import numpy as np

from addvc.runtime import job
from addvc.correlation.meso import pyramid_start, start_options
from addvc.correlation.store import save_field
from addvc.fem.io import read_mesh
from addvc.images.files import read_json
from addvc.images.levels import pyramid
from addvc.images.scans_store import load_coefficients

with job(snakemake):
    params, source = snakemake.params, snakemake.input
    mesh = read_mesh(source.mesh)
    grid = snakemake.wildcards.candidate == "platens"
    lines = [np.array(line) for line in read_json(source.lines)["lines"]] if grid else None
    splines = [load_coefficients(path) for path in (source.reference, source.deformed)]
    images = [pyramid(grey, params.meso["pyramid_levels"]) for grey, _ in splines]
    size = read_json(source.figures)["mean_edge"]
    options = start_options(params.meso, size, params.axis, splines[0][1])
    save_field(snakemake.output[0], pyramid_start(mesh, *images, options, lines))
