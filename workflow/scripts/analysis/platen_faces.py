"""Where the platens are in the reference and in each state, as the images show them."""

from addvc.runtime import job
from addvc.analysis.platens_check import opened, platen_faces
from addvc.images.files import write_json
from addvc.images.scans_store import load_volume

with job(snakemake) as log:
    reference, _ = load_volume(snakemake.input.reference)
    found = {}
    for state, path in zip(snakemake.params.states, snakemake.input.deformed, strict=True):
        found[state] = platen_faces(reference, load_volume(path)[0], snakemake.params.axis)
    log.info("platens, voxels: %s", found)
    if wrong := opened(found):
        log.warning("WARNING: %s", wrong)
    write_json(snakemake.output[0], found)
