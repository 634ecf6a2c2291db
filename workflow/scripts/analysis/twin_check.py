"""Whether the twin is what it claims to be."""

import numpy as np
import tifffile

from addvc.runtime import job
from addvc.analysis.twin_check import check_twin
from addvc.images.files import read_json, write_json
from addvc.twin import TwinOptions

with job(snakemake) as log:
    source = snakemake.input

    def scan(state):
        return tifffile.imread(source.scans[state]).T.astype(np.float32)

    found, cell_size = read_json(source.threshold), read_json(source.cell_size)
    options = TwinOptions.from_config(snakemake.params.twin)
    checks = check_twin(source.truth, options, found, cell_size, scan)
    for check in checks:
        log.log(20 if check["passed"] else 30, "%s", check)
    write_json(snakemake.output[0], {"checks": checks})
