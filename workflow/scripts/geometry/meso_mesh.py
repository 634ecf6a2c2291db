"""Fig. 5: a meso mesh of the whole specimen."""

from addvc.runtime import job
from addvc.config import meso_size
from addvc.fem.io import write_mesh
from addvc.fem.mesh import check_mesh
from addvc.geometry.meso import meso_mesh
from addvc.images.files import read_json, write_json
from addvc.images.specimen import Specimen

with job(snakemake):
    name = snakemake.wildcards.meso
    specimen = Specimen.from_dict(read_json(snakemake.input.specimen))
    cell = read_json(snakemake.input.cell_size)["cell_size"]
    size = meso_size(snakemake.config, name, cell)
    mesh = meso_mesh(specimen, size, snakemake.params.meso["margin"])
    write_json(snakemake.output.figures, check_mesh(mesh, name) | {"wanted_edge": size})
    write_mesh(snakemake.output.mesh, mesh)
