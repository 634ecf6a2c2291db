"""The foam of the twin: seeds, struts, radii."""

from addvc.runtime import job
from addvc.twin import TwinOptions, make_foam, save_foam

with job(snakemake) as log:
    options = TwinOptions.from_config(snakemake.params.twin)
    network = make_foam(options)
    log.info("%d struts, %d beams", network.strut.max() + 1, len(network.elements))
    save_foam(snakemake.output[0], network)
