"""SHA-256 of every scan, for the provenance in the report."""

from addvc.runtime import job
from addvc.images.files import write_json
from addvc.images.hashes import check_different, content_hash

with job(snakemake):
    scans = snakemake.params.scans
    hashes = {path: content_hash(files) for path, files in scans.items()}
    check_different(hashes)
    write_json(snakemake.output[0], hashes)
