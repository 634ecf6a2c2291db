"""The first page of the report, and the configuration as it was used."""

from pathlib import Path

from addvc.runtime import job
from addvc.images.files import atomic_path, read_json, write_json
from addvc.provenance import commit
from addvc.report.thumbnail import thumbnail
from addvc.report.words import front_page, linked

with job(snakemake):
    summary = read_json(snakemake.input.summary)
    scans = read_json(snakemake.input.scans) | {"sha256": read_json(snakemake.input.hashes)}
    summary["versions"]["report made at commit"] = commit()
    pictures = [thumbnail(path) for path in snakemake.input.picture]
    text = front_page(summary, snakemake.config, scans, *pictures)
    with atomic_path(snakemake.output.page) as temporary:
        Path(temporary).write_text(linked(text, snakemake.params.entries))
    write_json(snakemake.output.config, snakemake.config)
