"""A threshold whose height above the void is that of the case times a factor."""

from addvc.runtime import job
from addvc.geometry.threshold import find_threshold
from addvc.images.files import read_json, write_json
from addvc.images.scans_store import load_coefficients
from addvc.images.specimen import Specimen

with job(snakemake) as log:
    source, params = snakemake.input, snakemake.params
    levels = read_json(source.threshold)
    gamma = levels["void"] + params.factor * (levels["threshold"] - levels["void"])
    specimen = Specimen.from_dict(read_json(source.specimen))
    smooth, degree = load_coefficients(source.smooth)
    result = find_threshold(smooth, specimen, params.porosity, gamma, degree)
    log.info("threshold %.2f, porosity %.4f", result["threshold"], result["porosity"])
    write_json(snakemake.output[0], result)
