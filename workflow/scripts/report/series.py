"""The states of each mesh as one series that ParaView opens; what is in them."""

from pathlib import Path

from addvc.runtime import job
from addvc.analysis.fields import described
from addvc.fem.io import write_series
from addvc.images.files import write_json

with job(snakemake):
    write_json(snakemake.output.meaning, described(snakemake.params.strain))
    for path in snakemake.output.series:
        name = Path(path).stem
        write_series(path, {n: f"{name}_state{n}.vtu" for n in snakemake.params.states})
