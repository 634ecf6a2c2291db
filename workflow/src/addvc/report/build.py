"""The HTML report: snakemake's own, called on the figures once they are made."""

import logging
import os
import subprocess
import sys
from pathlib import Path

from addvc.errors import AddvcError
from addvc.images.files import atomic_path

log = logging.getLogger(__name__)


def build_report(
    output: str | Path, snakefile: str, config: str, stylesheet: str, target: str
) -> None:
    """Write `output` (.html, all figures inside, no network needed) for the rule `target`.

    Runs within the run that makes it, hence without taking its lock. Raises AddvcError with the
    end of snakemake's own words when it fails."""
    with atomic_path(output) as temporary:
        command = [
            sys.executable,
            "-m",
            "snakemake",
            target,
            "--report",
            str(temporary),
            "--report-stylesheet",
            stylesheet,
            "--nolock",
            "--snakefile",
            snakefile,
            "--configfile",
            config,
            "--cores",
            "1",
        ]
        quiet = os.environ | {"PYTHONWARNINGS": "ignore::RuntimeWarning"}  # of its own coroutines
        done = subprocess.run(command, capture_output=True, text=True, env=quiet)
        log.info("%s", done.stderr.strip())
        if done.returncode:
            raise AddvcError(
                f"snakemake --report ended with status {done.returncode}: "
                f"{done.stderr.strip()[-2000:]}"
            )
