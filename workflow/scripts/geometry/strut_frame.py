"""The foam as a frame of beams, thin struts included."""

from addvc.runtime import job
from addvc.geometry.region import Region
from addvc.geometry.strut_frame import save_frame, strut_frame
from addvc.images.files import read_json
from addvc.images.scans_store import load_volume

with job(snakemake) as log:
    source = snakemake.input
    levels, region = read_json(source.threshold), Region(**read_json(source.region))
    excess = load_volume(source.reference)[0] - levels["void"]
    blurred = load_volume(source.blurred)[0] - levels["void"]
    held = strut_frame(excess, blurred, levels["threshold"] - levels["void"], region)
    counts = len(held.frame.points), len(held.frame.pieces), int(held.loaded.sum())
    log.info("%d nodes, %d pieces, %d nodes where the frame is cut", *counts)
    save_frame(snakemake.output[0], held)
