"""Fig. 9: nodes whose curvature is penalised, and those in equilibrium."""

from addvc.runtime import job
from addvc.fem.io import read_mesh, write_mesh
from addvc.geometry.region import Region, node_classes
from addvc.images.files import read_json

with job(snakemake):
    mesh = read_mesh(snakemake.input.mesh)
    region = Region(**read_json(snakemake.input.region))
    classes = node_classes(mesh, region, snakemake.params.micro["sides"])
    write_mesh(snakemake.output[0], mesh, classes)
