"""The states of each mesh as one series that ParaView opens."""

from pathlib import Path

from addvc.runtime import job
from addvc.fem.io import write_series

with job(snakemake):
    for path in snakemake.output:
        name = Path(path).stem
        write_series(path, {n: f"{name}_state{n}.vtu" for n in snakemake.params.states})
