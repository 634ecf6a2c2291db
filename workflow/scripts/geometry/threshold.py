"""The grey level of the surface, by bisection on the porosity, or as given."""

from addvc.runtime import job
from addvc.geometry.threshold import find_threshold
from addvc.images.files import read_json, write_json
from addvc.images.scans_store import load_coefficients
from addvc.images.specimen import Specimen

with job(snakemake) as log:
    smooth, degree = load_coefficients(snakemake.input.smooth)
    specimen = Specimen.from_dict(read_json(snakemake.input.specimen))
    wanted = snakemake.params.geometry["threshold"]
    result = find_threshold(smooth, specimen, snakemake.params.porosity, wanted, degree)
    log.info("threshold %.4g, porosity %.4f", result["threshold"], result["porosity"])
    write_json(snakemake.output[0], result)
