"""What the finest meso mesh has found, near equilibrium of the frame of struts."""

from addvc.runtime import job
from addvc.correlation.meso import meso_options, meso_system
from addvc.correlation.micro import robust_scale
from addvc.correlation.network import network_fit
from addvc.correlation.network_risk import risk_data
from addvc.correlation.store import load_solution, save_solution
from addvc.correlation.uncertainty import Noise
from addvc.fem.io import read_mesh
from addvc.geometry.strut_frame import load_frame
from addvc.images.files import read_json
from addvc.images.scans_store import load_coefficients

with job(snakemake):
    source, params = snakemake.input, snakemake.params
    reference, degree = load_coefficients(source.reference)
    images = [reference, load_coefficients(source.deformed)[0]]
    mesh, levels = read_mesh(source.mesh), read_json(source.threshold)
    solution, found = load_solution(source.solution)
    size = read_json(source.figures)["mean_edge"]
    chosen = params.meso | {"l_l": found["l_l"]}
    system = meso_system(mesh, reference, meso_options(chosen, size, params.axis, False, degree))
    noise, scale = Noise(levels["noise"], params.blur), robust_scale(params.micro["robust"], levels)
    frame, micro = load_frame(source.frame), read_mesh(source.micro)
    data = risk_data(micro, len(frame.frame.points), images, system, scale, noise)
    solution, notes = network_fit(frame, mesh, solution, data, params.micro["nu"])
    save_solution(snakemake.output[0], solution, mesh, l_l=found["l_l"], **notes)
