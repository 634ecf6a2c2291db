"""Fig. 6: the hexahedral grid that reaches into the platens."""

from addvc.runtime import job
from addvc.fem.io import write_mesh
from addvc.geometry.grid import grid_lines, hex_grid
from addvc.images.files import read_json, write_json
from addvc.images.scans import load_volume
from addvc.images.specimen import Specimen

with job(snakemake):
    shape = load_volume(snakemake.input.volume)[0].shape
    specimen = Specimen.from_dict(read_json(snakemake.input.specimen))
    lines = grid_lines(shape, specimen, **snakemake.params.grid)
    write_json(snakemake.output.lines, {"lines": lines, "unit": "voxel"})
    write_mesh(snakemake.output.mesh, hex_grid(lines))
