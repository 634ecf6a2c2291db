"""All scans, before any work: there, whole, of one shape."""

from addvc.runtime import job
from addvc.images.files import write_json
from addvc.images.scans import ScanFormat
from addvc.images.scans_check import check_scans

with job(snakemake):
    settings = snakemake.params.settings
    factor, size = settings["bin"], snakemake.params.voxel_size_um
    form = ScanFormat(**settings["format"])
    rows = check_scans(snakemake.params.scans, form, factor, settings["crop"])
    notes = {"voxel_size_um": size, "bin": factor, "binned_voxel_size_um": size * factor}
    write_json(snakemake.output[0], {"scans": rows, **notes})
