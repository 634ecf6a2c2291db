"""Where the specimen is in the reference: platens, outline."""

from addvc.runtime import job, told
from addvc.images.files import write_json
from addvc.images.scans import load_volume
from addvc.images.specimen import find_specimen

with job(snakemake) as log:
    volume, _ = load_volume(snakemake.input[0])
    params = snakemake.params
    specimen = find_specimen(volume, params.axis, params.platens, params.outline)
    log.info(told(specimen.to_dict()))
    write_json(snakemake.output[0], specimen.to_dict())
