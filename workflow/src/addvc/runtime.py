"""What every job shares: its log, its threads, and the way an error is told. Used by scripts only."""

import contextlib
import logging
import os
import signal
import sys
import time
import traceback
from collections.abc import Iterator, Mapping
from numbers import Integral, Real
from pathlib import Path

from addvc.errors import MARK, AddvcError

INTERRUPTED = 130
"""Status of a job that Ctrl-C ends, as a shell has it."""


def _interrupted(*_) -> None:
    sys.exit(INTERRUPTED)


# From here on, hence the first import of each script; not where it is ignored, as under nohup.
if (
    "snakemake" in vars(sys.modules["__main__"])
    and signal.getsignal(signal.SIGINT) is signal.default_int_handler
):
    signal.signal(signal.SIGINT, _interrupted)


def job_name(rule: str, wildcards: dict) -> str:
    """`meso_dvc meso12 2`: the rule and its wildcards, for the head of each line."""
    return " ".join([rule, *(str(value) for value in wildcards.values())])


@contextlib.contextmanager
def job(snakemake) -> Iterator[logging.Logger]:
    """Progress to the log of the job and, from the level ADDVC_LOG (INFO) on, to the terminal; threads
    as the scheduler gave them.

    An error the user can mend (AddvcError) is told in one paragraph and ends the job with status 1; by
    the log alone where ADDVC_LOGGER says that `snakemake_logger_plugin_addvc` tells it. Any other keeps
    its traceback, which goes to the log as well; Ctrl-C ends it without one."""
    os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
    path = Path(snakemake.log[0])
    path.parent.mkdir(parents=True, exist_ok=True)
    name = job_name(snakemake.rule, dict(snakemake.wildcards.items()))
    log = logging.getLogger("addvc")
    log.setLevel(logging.INFO)
    terminal = logging.StreamHandler(sys.stderr)
    terminal.setLevel(os.environ.get("ADDVC_LOG", "INFO").upper())
    handlers = [logging.FileHandler(path, mode="w"), terminal]
    for handler in handlers:
        handler.setFormatter(logging.Formatter(f"%(asctime)s [{name}] %(message)s", "%H:%M:%S"))
        log.addHandler(handler)
    start = time.perf_counter()
    try:
        with threads(snakemake.threads):
            yield log
        log.info("done in %.1f s", time.perf_counter() - start)
    except AddvcError as error:
        if os.environ.get("ADDVC_LOGGER"):
            log.removeHandler(terminal)
        log.error("%s%s", MARK, error)
        sys.exit(1)
    except Exception:
        log.error("%s", traceback.format_exc())
        sys.exit(1)
    finally:
        for handler in handlers:
            log.removeHandler(handler)
            handler.close()


def told(figures: Mapping) -> str:
    """Figures as a log has them: "rms 0.0693, foam.micro.valid 456"; without None and lists."""
    return ", ".join(f"{name} {value}" for name, value in _flat(figures))


def _flat(figures: Mapping, lead: str = "") -> Iterator[tuple[str, str]]:
    for key, value in figures.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{lead}{key}.")
        elif isinstance(value, Integral | str):  # truth values are among them
            yield f"{lead}{key}", str(value)
        elif isinstance(value, Real):
            yield f"{lead}{key}", f"{value:.4g}"


@contextlib.contextmanager
def threads(count: int) -> Iterator[None]:
    """numba and BLAS on at most `count` threads: BLAS threads inside parallel kernels cost time.

    Most figures do without numba, which is slow to load: it then finds its number when it is."""
    from threadpoolctl import threadpool_limits

    if "numba" in sys.modules:
        numba = sys.modules["numba"]
        numba.set_num_threads(min(count, numba.config.NUMBA_NUM_THREADS))
    else:
        most = int(os.environ.get("NUMBA_NUM_THREADS", count))
        os.environ["NUMBA_NUM_THREADS"] = str(min(count, most))
    with threadpool_limits(limits=count):
        yield


def progress(log: logging.Logger, what: str, every: float = 10.0):
    """A callback (done, total) that says how far `what` is, and the time left, every few seconds."""
    start = time.perf_counter()
    last = [start]

    def tell(done: int, total: int) -> None:
        now = time.perf_counter()
        if now - last[0] >= every and done:
            last[0] = now
            left = (now - start) * (total - done) / done
            log.info("%s: %d of %d, about %.0f s left", what, done, total, left)

    return tell
