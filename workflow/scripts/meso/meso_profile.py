"""Where along the loading axis the finest mesh of meso DVC leaves its residual, all states together."""

from addvc.runtime import job
from addvc.correlation.meso_profile import squared_residual
from addvc.correlation.store import load_field
from addvc.fem.io import read_mesh
from addvc.images.files import read_json, write_json
from addvc.images.scans_store import load_coefficients

with job(snakemake):
    source = snakemake.input
    coefficients, degree = load_coefficients(source.reference)
    files = zip(source.deformed, source.solutions, strict=True)
    states = ((load_coefficients(image)[0], load_field(u)) for image, u in files)
    gamma, mesh = read_json(source.threshold)["threshold"], read_mesh(source.mesh)
    axis = snakemake.params.axis
    square, count = squared_residual(mesh, coefficients, states, gamma, axis, degree)
    write_json(snakemake.output[0], {"square": square, "count": count, "unit": "grey level^2"})
