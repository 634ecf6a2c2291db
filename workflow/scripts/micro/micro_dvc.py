"""Micro DVC of one state by one method, from the best start on the micro mesh."""

from addvc.runtime import job
from addvc.config import METHODS
from addvc.correlation.corotational import corotational
from addvc.correlation.micro import micro_reference, plan, problem_of, shell_of
from addvc.correlation.register import Stop, System, register
from addvc.correlation.store import load_factor, load_field, load_order, save_solution
from addvc.fem.io import read_mesh
from addvc.fem.shell import load_quadrature
from addvc.images.files import read_json
from addvc.images.scans_store import load_coefficients

with job(snakemake):
    source, method, micro = snakemake.input, snakemake.params.method, snakemake.params.micro
    shell = shell_of(method, load_quadrature(source.shell))
    grey, degree = load_coefficients(source.reference)
    reference = micro_reference(read_mesh(source.mesh), grey, shell, degree)
    deformed, start = load_coefficients(source.deformed)[0], load_field(source.start)
    if METHODS[method].gap:
        factor, extra, notes = load_factor(source.factor)
        stop = Stop(micro["tolerance"], micro["max_iterations"])
        solution = register(System(reference, extra, factor), deformed, start, stop, "micro DVC")
    else:
        order, notes = load_order(source.factor)
        problem = problem_of(reference, notes, micro["nu"], order, read_json(source.bridges))
        steps = plan(micro, read_json(source.threshold), snakemake.params.blur, method)
        solution, notes = corotational(problem, deformed, start, *steps)
    save_solution(snakemake.output[0], solution, reference.mesh, **notes)
