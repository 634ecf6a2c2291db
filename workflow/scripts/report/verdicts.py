"""The closing lines of a run; with `strict`, an error when a state could not be registered."""

from pathlib import Path

from addvc.runtime import job
from addvc.images.files import atomic_path, read_json
from addvc.report.words import check_verdicts, closing_lines

with job(snakemake):
    summary = read_json(snakemake.input[0])
    with atomic_path(snakemake.output[0]) as temporary:
        Path(temporary).write_text(closing_lines(summary, snakemake.params.folder) + "\n")
    check_verdicts(summary, snakemake.params.strict)
