"""What the figures show, in a page beside them."""

from pathlib import Path

from addvc.runtime import job
from addvc.images.files import atomic_path
from addvc.report.captions import captions_page

with job(snakemake):
    page = captions_page(snakemake.params.entries)
    with atomic_path(snakemake.output[0]) as temporary:
        Path(temporary).write_text(page, encoding="utf-8")
