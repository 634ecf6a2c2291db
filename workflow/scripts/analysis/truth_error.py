"""The errors of one state against the known truth, at bulk nodes of the micro mesh (less torn ones)."""

from addvc.runtime import job, told
from addvc.analysis.truth import errors_at, judged_nodes, load_truth
from addvc.correlation.store import load_field, load_notes
from addvc.fem.io import read_vtu
from addvc.images.files import write_json

with job(snakemake) as log:
    points, cells, classes, _ = read_vtu(snakemake.input.mesh)
    torn = load_notes(snakemake.input.torn).get("torn_cells", []) if snakemake.input.torn else []
    judged = judged_nodes(cells, classes["penalised"], torn)
    fields = (load_field(path)[judged] for path in snakemake.input.fields)
    state = int(snakemake.wildcards.state)
    found = errors_at(load_truth(snakemake.input.truth), points[judged], fields, state)
    for path, result in zip(snakemake.output, found, strict=True):
        log.info("%s: %s", path, told(result))
        write_json(path, result)
