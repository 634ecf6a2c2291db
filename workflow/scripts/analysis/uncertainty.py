"""The standard uncertainty of each node and strut from the noise of the images."""

from addvc.runtime import job, told
from addvc.analysis.noise import (
    figures,
    save_uncertainty,
    standard_uncertainty,
    strut_uncertainty,
)
from addvc.analysis.strut_store import load_partition
from addvc.correlation.store import load_field
from addvc.images.files import write_json

with job(snakemake) as log:
    draws = load_field(snakemake.input.noise)
    nodes = standard_uncertainty(draws)
    struts = strut_uncertainty(load_partition(snakemake.input.struts)[0], draws)
    found = figures(nodes, struts, len(draws))
    log.info(told(found))
    save_uncertainty(snakemake.output.arrays, nodes, struts)
    write_json(snakemake.output.figures, found)
