"""The motion of the twin: what the scans show, and the truth they are judged by."""

from addvc.runtime import job
from addvc.twin import TwinOptions, compress, load_foam, save_motions, write_history, write_network

with job(snakemake) as log:
    options, out = TwinOptions.from_config(snakemake.params.twin), snakemake.output
    network = load_foam(snakemake.input[0])

    def tell(step):
        log.info("strain %.4f: in equilibrium after %d steps", step.strain, step.steps)

    motions, history = compress(network, options, tell)
    for path, motion in zip(out.networks, motions, strict=True):
        write_network(path, network, motion, options)
    write_history(out.history, history)
    save_motions(out.motion, network, motions, options, history)
