"""The micro result in 3D, to look around in a browser."""

from addvc.runtime import job
from addvc.report.case import Case
from addvc.report.look_around import write_scene

with job(snakemake):
    case = Case.of(snakemake.params.case, [str(path) for path in snakemake.input])
    write_scene(case, snakemake.input.template, snakemake.output[0])
