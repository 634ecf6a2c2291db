"""Strain at the scale of a cell in one state, and the bands in which it gathers."""

from addvc.runtime import job, told
from addvc.analysis.cell_strain import cell_strain, columns, described
from addvc.analysis.localisation import MEANING, localisation
from addvc.analysis.strut_store import write_columns
from addvc.fem.io import read_mesh, read_vtu
from addvc.fem.mesh import nodal_volumes
from addvc.images.files import read_json, write_json

with job(snakemake) as log:
    source, axis = snakemake.input, snakemake.params.axis
    mesh, size = read_mesh(source.mesh), read_json(source.cell_size)["cell_size"]
    point = read_vtu(source.field)[2]
    weight, valid = nodal_volumes(mesh), point["valid"].ravel()
    found = cell_strain(mesh.points, point["displacement"], weight, valid, size)
    figures = localisation(found.points, found.along(axis), axis, size)
    log.info(told(figures))
    write_columns(snakemake.output.table, columns(found, axis))
    notes = {"localisation": figures, "meaning": MEANING, "columns": described()}
    write_json(snakemake.output.notes, notes)
