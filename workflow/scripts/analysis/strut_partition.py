"""The micro mesh cut into struts and junctions."""

from addvc.runtime import job
from addvc.analysis.strut_store import save_partition, strut_of_cells
from addvc.analysis.struts import partition
from addvc.fem.io import read_mesh, write_mesh
from addvc.geometry.skeleton import strut_graph
from addvc.images.files import read_json
from addvc.images.scans_store import load_volume

with job(snakemake) as log:
    source = snakemake.input
    mesh, levels = read_mesh(source.mesh), read_json(source.threshold)
    graph = strut_graph(load_volume(source.solid)[0] > levels["threshold"])
    struts = partition(mesh, graph, load_volume(source.reference)[0] - levels["void"])
    counts = len(struts), len(graph.branches), len(graph.junctions)
    log.info("%d struts of %d branches between %d junctions", *counts)
    save_partition(snakemake.output.struts, struts, graph.junctions)
    write_mesh(snakemake.output.picture, mesh, None, {"strut": strut_of_cells(struts, mesh)})
