"""Whether the errors of micro DVC are those that the noise lets expect, at valid bulk nodes."""

from addvc.runtime import job, told
from addvc.analysis.noise import calibration, load_uncertainty
from addvc.analysis.truth import load_truth
from addvc.fem.io import read_vtu
from addvc.images.files import write_json

with job(snakemake) as log:
    source, state = snakemake.input, int(snakemake.wildcards.state)
    points, _, measured, _ = read_vtu(source.field)
    use = (read_vtu(source.mesh)[2]["penalised"].ravel() == 0) & (measured["valid"] > 0)
    true = load_truth(source.truth).displacement(points[use], state)
    nodes, _ = load_uncertainty(source.uncertainty)
    found = calibration(measured["displacement"][use] - true, nodes[use])
    log.info(told(found))
    write_json(snakemake.output[0], found)
