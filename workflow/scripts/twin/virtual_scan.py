"""A virtual state: the reference scan warped by a known field, with fresh noise."""

from addvc.runtime import job
from addvc.images.scans import ScanFormat, open_scan, read_binned
from addvc.twin import write_scan
from addvc.twin.virtual import VirtualField, warp

with job(snakemake):
    settings, virtual = snakemake.params.settings, snakemake.params.virtual
    scan = open_scan(snakemake.params.scan, ScanFormat(**settings["format"]))
    volume = read_binned(scan, 1, settings["crop"]).astype(scan.dtype)
    field = VirtualField.load(snakemake.input.field)
    state = int(snakemake.wildcards.state)
    moved = warp(volume, field, state, settings["bin"], virtual["noise"], virtual["seed"])
    write_scan(snakemake.output[0], moved)
