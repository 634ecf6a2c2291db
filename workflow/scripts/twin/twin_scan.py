"""A scan of the twin, as the TIFF pages that a scanner would give."""

from addvc.runtime import job
from addvc.twin import TwinOptions, image, load_foam, load_motions, write_scan

with job(snakemake):
    options = TwinOptions.from_config(snakemake.params.twin)
    state = int(snakemake.wildcards.state)
    network = load_foam(snakemake.input.foam)
    motion = load_motions(snakemake.input.motion)[state]
    write_scan(snakemake.output[0], image(network, motion, options, state))
