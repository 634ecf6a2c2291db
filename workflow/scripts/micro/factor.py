"""Eq. 10, or with an elastic energy: A = H + M of the micro mesh, factorised once for all states."""

from addvc.runtime import job
from addvc.config import METHODS
from addvc.correlation.micro import elastic, eq10, micro_options, micro_reference, shell_of
from addvc.correlation.store import save_factor
from addvc.fem.io import read_vtu
from addvc.fem.mesh import Mesh
from addvc.fem.shell import load_quadrature
from addvc.fem.solver import factorise
from addvc.images.files import read_json
from addvc.images.scans_store import load_coefficients

with job(snakemake) as log:
    source, params = snakemake.input, snakemake.params
    points, cells, classes, _ = read_vtu(source.mesh)
    cell = read_json(source.cell_size)["cell_size"]
    options = micro_options(params.micro, cell, params.axis)
    shell = shell_of(params.method, load_quadrature(source.shell))
    grey, degree = load_coefficients(source.reference)
    reference = micro_reference(Mesh(points, cells), grey, shell, degree)
    if METHODS[params.method].gap:
        matrix, extra, weights = eq10(reference, classes["penalised"] > 0, options)
    else:
        matrix, extra, weights = elastic(reference, options)
    factor = factorise(matrix)
    log.info("%d unknowns, %d nonzeros in the factor", len(factor.order), factor.nonzeros)
    save_factor(snakemake.output[0], factor, extra, weights)
