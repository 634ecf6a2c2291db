"""Fig. 7: the closed surface of the solid, by marching cubes."""

from addvc.runtime import job
from addvc.fem.io import write_vtu
from addvc.geometry.surface import check_watertight, marching_cubes
from addvc.images.files import read_json
from addvc.images.scans import load_volume

with job(snakemake) as log:
    grey, _ = load_volume(snakemake.input.solid)
    surface = marching_cubes(grey, read_json(snakemake.input.threshold)["threshold"])
    check_watertight(surface, "surface of the solid")
    log.info("%d triangles", len(surface.faces))
    write_vtu(snakemake.output[0], surface.points, surface.faces)
