"""Appendix A: a meso displacement at the nodes of the micro mesh."""

from addvc.correlation.store import load_solution, save_field
from addvc.correlation.transfer import transfer_matrix
from addvc.fem.io import read_mesh
from addvc.runtime import job

with job(snakemake) as log:
    source = snakemake.input
    into, outside = transfer_matrix(read_mesh(source.mesh), read_mesh(source.micro).points)
    log.info("%d of %d nodes are outside of the meso mesh: extrapolated", outside, into.shape[0])
    save_field(snakemake.output[0], into @ load_solution(source.solution)[0].u, outside=outside)
