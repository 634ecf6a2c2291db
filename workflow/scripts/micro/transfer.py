"""Appendix A: meso displacements of one state at the nodes of the micro mesh."""

from addvc.runtime import job
from addvc.correlation.store import load_field, save_field
from addvc.correlation.transfer import transfer_matrix
from addvc.fem.io import read_mesh

with job(snakemake) as log:
    source = snakemake.input
    nodes = read_mesh(source.micro).points
    for mesh, solution, result in zip(
        source.meshes, source.solutions, snakemake.output, strict=True
    ):
        into, outside = transfer_matrix(read_mesh(mesh), nodes)
        log.info("%s: %d of %d nodes are outside: extrapolated", mesh, outside, len(nodes))
        save_field(result, into @ load_field(solution), outside=outside)
