"""Dangling stubs, necks and welds of the micro mesh."""

from addvc.runtime import job, told
from addvc.analysis.strut_store import load_partition
from addvc.analysis.topology import Moved, topology
from addvc.correlation.store import load_field
from addvc.fem.io import read_vtu
from addvc.fem.mesh import Mesh
from addvc.geometry.skeleton import strut_graph
from addvc.images.files import read_json, write_json
from addvc.images.scans_store import load_volume

with job(snakemake) as log:
    source = snakemake.input
    points, cells, classes, _ = read_vtu(source.mesh)
    solid = load_volume(source.solid)[0] > read_json(source.threshold)["threshold"]
    struts, _ = load_partition(source.struts)
    states = [
        Moved(state, load_field(before), load_field(after))
        for state, before, after in zip(
            snakemake.params.states, source.starts, source.solutions, strict=True
        )
    ]
    cut = classes["surface"].ravel() > 0
    mesh, bridges = Mesh(points, cells), read_json(source.bridges)
    found = topology(mesh, cut, strut_graph(solid), struts, states, bridges)
    log.info(told(found["counts"]))
    write_json(snakemake.output[0], found)
