"""The void voxels around the struts that micro DVC also looks at."""

from addvc.runtime import job
from addvc.fem.io import read_mesh
from addvc.fem.shell import save_quadrature, shell_points
from addvc.images.files import read_json
from addvc.images.scans_store import load_volume

with job(snakemake) as log:
    source = snakemake.input
    gamma = read_json(source.threshold)["threshold"]
    grey = load_volume(source.reference)[0]
    shell = shell_points(read_mesh(source.mesh), grey, gamma, snakemake.params.width)
    log.info("%d void voxels around the struts", len(shell))
    save_quadrature(snakemake.output[0], shell)
