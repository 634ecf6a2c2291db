"""A scan as the binned, cropped volume that everything works on."""

from addvc.runtime import job, progress
from addvc.images.scans import ScanFormat, open_scan, read_binned, save_volume

with job(snakemake) as log:
    settings = snakemake.params.settings
    scan = open_scan(snakemake.params.scan, ScanFormat(**settings["format"]))
    factor = settings["bin"]
    volume = read_binned(scan, factor, settings["crop"], progress(log, "slabs read"))
    log.info("%s: %s voxels %s, binned %s", scan.path, scan.dtype, scan.shape, volume.shape)
    save_volume(snakemake.output[0], volume, {"bin": factor})
