"""A candidate start that is defined everywhere, at the nodes of the micro mesh."""

from addvc.runtime import job
from addvc.correlation.candidates import candidate
from addvc.correlation.store import save_field
from addvc.fem.io import read_mesh

with job(snakemake):
    source, name = snakemake.input, snakemake.wildcards.field
    field = candidate(name, source, snakemake.params.axis)
    save_field(snakemake.output[0], field(read_mesh(source.mesh).points))
