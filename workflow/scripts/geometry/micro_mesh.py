"""Fig. 8: the finite elements of the struts."""

from addvc.runtime import job
from addvc.fem.io import read_vtu, write_mesh
from addvc.geometry.micro import micro_mesh
from addvc.geometry.region import Region
from addvc.geometry.surface import Surface
from addvc.images.files import read_json, write_json
from addvc.images.scans import load_volume

with job(snakemake):
    grey, notes = load_volume(snakemake.input.solid)
    points, faces, _, _ = read_vtu(snakemake.input.surface)
    gamma = read_json(snakemake.input.threshold)["threshold"]
    region = Region(**read_json(snakemake.input.region))
    surface, options = Surface(points, faces), snakemake.params.mesh
    mesh, figures = micro_mesh(grey, gamma, surface, region, options)
    write_mesh(snakemake.output.mesh, mesh)
    keys = ("components", "kept_fraction", "dropped_voxels")
    write_json(snakemake.output.figures, figures | {f"voxel_{key}": notes[key] for key in keys})
