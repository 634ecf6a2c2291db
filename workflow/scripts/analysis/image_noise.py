"""What the noise of both images alone leaves of the residual, in each state."""

from addvc.runtime import job
from addvc.analysis.image_noise import pair_noise
from addvc.images.files import read_json, write_json
from addvc.images.scans_store import load_coefficients
from addvc.images.specimen import Specimen

with job(snakemake) as log:
    source = snakemake.input
    specimen = Specimen.from_dict(read_json(source.specimen))
    gamma = read_json(source.threshold)["threshold"]
    reference, degree = load_coefficients(source.reference)
    noise = dict.fromkeys(snakemake.params.states)
    files = [] if snakemake.params.moves else zip(noise, source.deformed, strict=True)
    for state, path in files:
        noise[state] = pair_noise(reference, load_coefficients(path)[0], specimen, gamma, degree)
    log.info("residual of noise alone, grey levels: %s", noise)
    write_json(snakemake.output[0], noise)
