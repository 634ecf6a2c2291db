"""The free-form displacement at the nodes of a mesh."""

from addvc.correlation.spline_grid import SplineGrid, evaluate
from addvc.correlation.store import load_solution, save_field
from addvc.fem.io import read_mesh
from addvc.runtime import job

with job(snakemake):
    solution, notes = load_solution(snakemake.input.solution)
    grid = SplineGrid(**notes["grid"])
    nodes = read_mesh(snakemake.input.mesh).points
    u = evaluate(grid, solution.u.reshape(*grid.shape, 3), nodes)
    save_field(snakemake.output[0], u)
