"""Elastix on one state of a case: errors at the bulk nodes of the micro mesh, CPU seconds."""

from pathlib import Path

from benchmark.elastix import ElastixOptions, displacement, elastix, near_solid
from benchmark.study import bulk_nodes, truth_of

from addvc.runtime import job
from addvc.analysis.truth import errors_at
from addvc.images.files import read_json, write_json
from addvc.images.scans_store import load_volume

with job(snakemake) as log:
    config = read_json(snakemake.input[0])
    folder, state = Path(snakemake.params.folder), int(snakemake.wildcards.state)
    options = ElastixOptions(float(snakemake.wildcards.spacing), **snakemake.params.settings)
    images = [load_volume(folder / f"volumes/volume{n}.h5")[0] for n in (0, state)]
    solid = load_volume(folder / "volumes/smooth0.h5")[0]
    threshold = read_json(folder / "geometry/threshold.json")["threshold"]
    transform, cpu = elastix(*images, options, near_solid(solid, threshold))
    points, bulk = bulk_nodes(folder)
    u = displacement(transform, images[0].shape, points[bulk])
    (found,) = errors_at(truth_of(config), points[bulk], [u], state)
    log.info("%s in %.0f CPU-s", found, cpu)
    write_json(snakemake.output[0], found | {"cpu_s": cpu})
