"""Eq. 9: meso DVC on each mesh, coarse to fine, from the coarser one or the best start beside it."""

from addvc.runtime import job
from addvc.correlation.candidates import candidate, mesh_field
from addvc.correlation.meso import cutoff_ladder, meso_dvc, meso_options
from addvc.correlation.store import load_notes, save_solution
from addvc.fem.io import read_mesh
from addvc.images.files import read_json
from addvc.images.scans_store import load_coefficients

with job(snakemake):
    source, params = snakemake.input, snakemake.params
    reference, degree = load_coefficients(source.reference)
    images = [reference, load_coefficients(source.deformed)[0]]
    ladder = cutoff_ladder(params.meso, read_json(source.threshold), params.blur)
    others = {name: candidate(name, source, params.axis) for name in params.names}
    coarser = {load_notes(source.start)["best"]: mesh_field(source.meshes[0], source.start)}
    files = zip(params.meshes, source.meshes, source.figures, snakemake.output, strict=True)
    for name, path, figures, output in files:
        coarsest = name == params.meshes[0]
        size = read_json(figures)["mean_edge"]
        options = meso_options(params.meso, size, params.axis, coarsest, degree)
        fields = coarser if coarsest else coarser | others
        mesh = read_mesh(path)
        solution, notes = meso_dvc(mesh, images, options, fields, name, ladder)
        save_solution(output, solution, mesh, **notes)
        coarser = {name: mesh_field(path, output)}
