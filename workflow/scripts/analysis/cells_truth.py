"""Strain at the scale of a cell, and its bands, against the truth."""

import numpy as np

from addvc.runtime import job, told
from addvc.analysis.cell_strain import cell_strain, columns
from addvc.analysis.localisation import compared, localisation
from addvc.analysis.strut_store import read_columns, write_columns
from addvc.analysis.truth import load_truth
from addvc.fem.io import read_mesh
from addvc.fem.mesh import nodal_volumes
from addvc.images.files import read_json, write_json

with job(snakemake) as log:
    source, axis, state = snakemake.input, snakemake.params.axis, int(snakemake.wildcards.state)
    mesh, size = read_mesh(source.mesh), read_json(source.cell_size)["cell_size"]
    u = load_truth(source.truth).displacement(mesh.points, state)
    true = cell_strain(mesh.points, u, nodal_volumes(mesh), np.ones(len(u)), size)
    band = localisation(true.points, true.along(axis), axis, size)
    strain = read_columns(source.table)["axial_strain"]
    measured = read_json(source.notes)["localisation"]
    figures = compared(measured, band, strain, true.along(axis).ravel())
    log.info(told(figures))
    write_columns(snakemake.output.table, columns(true, axis))
    write_json(snakemake.output.figures, figures)
