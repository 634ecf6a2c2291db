"""Fig. 8: the region of micro DVC and its grey levels, capped, largest component only."""

from dataclasses import asdict

from addvc.geometry.region import micro_region
from addvc.geometry.surface import region_solid
from addvc.images.files import read_json, write_json
from addvc.images.scans import load_volume, save_volume
from addvc.images.specimen import Specimen
from addvc.runtime import job

with job(snakemake):
    smooth, notes = load_volume(snakemake.input.smooth)
    specimen = Specimen.from_dict(read_json(snakemake.input.specimen))
    region = micro_region(specimen, snakemake.params.micro["region"])
    levels = read_json(snakemake.input.threshold)
    grey, figures = region_solid(smooth, levels, region, snakemake.params.mesh["min_kept"])
    save_volume(snakemake.output.solid, grey, notes["voxel_size_um"], figures)
    write_json(snakemake.output.region, asdict(region))
