"""Make the foam and compress it: the solve of many minutes whose result is kept as a fixture.

`PYTHONPATH=workflow/src:tests python -m solid_twin.make FILE`
"""

import logging
import sys
import time
from importlib.metadata import version

from addvc.fem.mesh import check_mesh
from solid_twin.compression import Step, compress
from solid_twin.fixture import rounded, save_record
from solid_twin.foam import Foam, make_foam
from solid_twin.platens import Press
from solid_twin.solid import Solid, quadratic

log = logging.getLogger("solid_twin")

STRAINS = [0.04, 0.08, 0.15]
PACKAGES = ("numpy", "scipy", "numba", "scikit-sparse", "pymetis", "scikit-image")


def make(path: str) -> None:
    """Foam, mesh, equilibria at STRAINS; progress to the log, the result to `path`."""
    start, foam, steps = time.process_time(), Foam(), []
    mesh = rounded(make_foam(foam))
    figures = check_mesh(mesh, "foam")
    log.info("%s", figures)

    def each(step: Step) -> None:
        steps.append(step)
        log.info("strain %.4f, force %.4f, energy %.5f, %d factorisations, %.0f CPU-s",
                 step.strain, step.force, step.energy, step.solves,
                 time.process_time() - start)  # fmt: skip

    compress(Solid(quadratic(mesh)), Press(foam.low, foam.high), STRAINS, each=each)
    made = {
        "command": "PYTHONPATH=workflow/src:tests python -m solid_twin.make FILE",
        "cpu_seconds": round(time.process_time() - start),
        "factorisations": steps[-1].solves,
        "mesh": figures,
        "versions": {"python": sys.version.split()[0]} | {name: version(name) for name in PACKAGES},
    }
    save_record(path, foam, mesh, steps, STRAINS, made)


if __name__ == "__main__":
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    make(sys.argv[1])
