"""How well each displacement of one state carries the reference onto the deformed image."""

import numpy as np

from addvc.runtime import job, told
from addvc.analysis.overlap import REST, overlap
from addvc.correlation.store import load_field
from addvc.fem.io import read_mesh
from addvc.geometry.region import Region
from addvc.images.files import read_json, write_json
from addvc.images.scans_store import load_volume

with job(snakemake) as log:
    source = snakemake.input
    mesh, region = read_mesh(source.mesh), Region(**read_json(source.region))
    gamma, image = read_json(source.threshold)["threshold"], load_volume(source.deformed)[0]
    still, reference = np.zeros_like(mesh.points), load_volume(source.reference)[0]
    found = {REST: overlap(mesh, still, reference, gamma, region)}
    for name, path in zip(snakemake.params.names, source.fields, strict=True):
        found[name] = overlap(mesh, load_field(path), image, gamma, region)
    log.info(told(found))
    write_json(snakemake.output[0], found)
