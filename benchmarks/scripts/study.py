"""Run the workflow on a case, up to its errors; the output is its configuration with all defaults."""

import subprocess
import sys
from pathlib import Path

import yaml
from benchmark.study import targets
from snakemake.utils import validate

from addvc.runtime import job
from addvc.images.files import write_json

with job(snakemake):
    given = snakemake.input.config
    config = yaml.safe_load(Path(given).read_text())
    validate(config, snakemake.params.schema)
    wanted = targets(config["case"], snakemake.params.states)
    command = f"-m snakemake --nolock --rerun-incomplete --cores {snakemake.threads} --configfile"
    subprocess.run([sys.executable, *command.split(), given, "--", *wanted], check=True)
    write_json(snakemake.output[0], config)
