"""SHA-256 of every scan, for the provenance in the report."""

from addvc.images.files import write_json
from addvc.images.hashes import content_hash
from addvc.runtime import job

with job(snakemake):
    scans = snakemake.params.scans
    write_json(snakemake.output[0], {path: content_hash(files) for path, files in scans.items()})
