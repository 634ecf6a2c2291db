"""How hard the test is: what the best field of each meso mesh would leave of each state."""

from addvc.runtime import job
from addvc.analysis.difficulty import difficulty, projections
from addvc.analysis.truth import load_truth
from addvc.correlation.micro import micro_reference
from addvc.fem.io import read_mesh, read_vtu
from addvc.fem.mesh import Mesh
from addvc.images.files import write_json
from addvc.images.scans_store import load_coefficients

with job(snakemake):
    source, names = snakemake.input, snakemake.params.meso
    points, cells, classes, _ = read_vtu(source.mesh)
    nodes = points[classes["penalised"] == 0]
    grey, degree = load_coefficients(source.reference)
    reference = micro_reference(Mesh(points, cells), grey, degree=degree)
    meshes = {name: read_mesh(path) for name, path in zip(names, source.meso, strict=True)}
    best = projections(reference, nodes, meshes)
    truth = load_truth(source.truth)
    found = [
        difficulty(truth, reference, load_coefficients(path)[0], state, nodes, best)
        for state, path in zip(snakemake.params.states, source.deformed, strict=True)
    ]
    write_json(snakemake.output[0], {"states": found})
