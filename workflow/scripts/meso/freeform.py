"""Free-form DVC of one state: a cubic B-spline grid, coarse to fine, from rest."""

from dataclasses import asdict, replace

from addvc.runtime import job
from addvc.correlation.freeform import freeform, freeform_options
from addvc.correlation.store import save_solution
from addvc.images.files import read_json
from addvc.images.scans_store import load_coefficients

with job(snakemake):
    source, params = snakemake.input, snakemake.params
    cell = read_json(source.cell_size)["cell_size"]
    reference, degree = load_coefficients(source.reference)
    options = freeform_options(params.freeform, cell, params.axis, degree)
    grid, solution, levels = freeform(reference, load_coefficients(source.deformed)[0], options)
    flat = replace(solution, u=solution.u.reshape(-1, 3))
    save_solution(snakemake.output[0], flat, grid=asdict(grid), levels=levels)
