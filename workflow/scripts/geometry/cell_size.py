"""Fig. 4: the cell size, measured or given."""

from addvc.runtime import job
from addvc.geometry.cell_size import measure_cell_size
from addvc.images.files import read_json, write_json
from addvc.images.scans import load_volume
from addvc.images.specimen import Specimen

with job(snakemake) as log:
    volume, _ = load_volume(snakemake.input.volume)
    specimen = Specimen.from_dict(read_json(snakemake.input.specimen))
    result = measure_cell_size(volume, specimen, snakemake.params.geometry["cell_size"])
    log.info("cell size %.2f voxels (%s)", result["cell_size"], result["source"])
    write_json(snakemake.output[0], result)
