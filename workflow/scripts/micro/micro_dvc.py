"""Eq. 10: micro DVC of one state, from the finest meso result."""

from addvc.correlation.micro import micro_reference
from addvc.correlation.register import Stop, System, register
from addvc.correlation.store import load_factor, load_field, save_solution
from addvc.fem.io import read_mesh
from addvc.images.scans import load_volume
from addvc.runtime import job

with job(snakemake):
    source, micro = snakemake.input, snakemake.params.micro
    reference = micro_reference(read_mesh(source.mesh), load_volume(source.reference)[0])
    factor, extra, weights = load_factor(source.factor)
    stop = Stop(micro["tolerance"], micro["max_iterations"])
    solution = register(
        System(reference, extra, factor),
        load_volume(source.deformed)[0],
        load_field(source.start),
        stop,
        "micro DVC",
    )
    save_solution(snakemake.output[0], solution, weights=weights)
