"""Fig. 8: the region of micro DVC and its grey levels, capped, largest component only."""

from dataclasses import asdict

from addvc.runtime import job
from addvc.geometry.bridges import bridged
from addvc.geometry.region import micro_region, worst_slab
from addvc.geometry.surface import region_solid
from addvc.images.files import read_json, write_json
from addvc.images.scans import load_volume, save_volume
from addvc.images.specimen import Specimen

with job(snakemake):
    smooth, _ = load_volume(snakemake.input.smooth)
    specimen = Specimen.from_dict(read_json(snakemake.input.specimen))
    setting, sides = snakemake.params.micro["region"], snakemake.params.sides
    if snakemake.input.profile:
        setting = worst_slab(specimen, setting, **read_json(snakemake.input.profile))
    region = micro_region(specimen, setting, sides=sides)
    levels = read_json(snakemake.input.threshold)
    mesh, bridges = snakemake.params.mesh, []
    if mesh["mend"] == "bridge":
        reference, _ = load_volume(snakemake.input.reference)
        smooth, bridges = bridged(smooth, reference, levels, region, mesh["size"])
    grey, figures = region_solid(smooth, levels, region, mesh["min_kept"])
    save_volume(snakemake.output.solid, grey, figures)
    write_json(snakemake.output.region, asdict(region))
    write_json(snakemake.output.bridges, bridges)
