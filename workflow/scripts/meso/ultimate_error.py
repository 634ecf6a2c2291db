"""Table 2: the ultimate error of a meso mesh, by sub-voxel shifts."""

from dataclasses import replace

from addvc.runtime import job
from addvc.correlation.meso import meso_options, meso_system
from addvc.correlation.store import load_notes
from addvc.correlation.ultimate import STOP, ultimate_error
from addvc.correlation.uncertainty import Noise
from addvc.fem.io import read_mesh
from addvc.images.files import read_json, write_json
from addvc.images.scans_store import load_coefficients

with job(snakemake):
    source, params = snakemake.input, snakemake.params
    size = read_json(source.figures)["mean_edge"]
    coefficients, degree = load_coefficients(source.reference)
    options = meso_options(params.meso, size, params.axis, params.coarsest, degree)
    if source.get("solution"):
        options = replace(options, cutoff=load_notes(source.solution)["l_l"])
    system = meso_system(read_mesh(source.mesh), coefficients, options)
    shifts = params.ultimate_error["shifts"]
    noise = Noise(read_json(source.threshold)["noise"], params.images["blur"])
    write_json(snakemake.output[0], ultimate_error(system, coefficients, shifts, STOP, noise))
