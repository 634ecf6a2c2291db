"""The motion of the twin: what the scans show, and the truth they are judged by."""

from addvc.runtime import job
from addvc.twin import TwinOptions, deform, load_foam, save_motions

with job(snakemake):
    options = TwinOptions.from_config(snakemake.params.twin)
    network = load_foam(snakemake.input[0])
    save_motions(snakemake.output[0], network, deform(network, options), options)
