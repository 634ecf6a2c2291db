"""A line in the terminal for each job that is done, by the logger interface of Snakemake.

`./addvc run` asks for it (`--logger addvc`). It takes the place of what Snakemake says in the terminal
about jobs that go well; warnings, errors and failed logs pass as they are, a dry run as a whole, and
`.snakemake/log` has everything. It is beside `addvc`, which knows nothing of Snakemake.
"""

import sys
import time
from logging import WARNING, LogRecord
from typing import Any

from snakemake.logging import ColorizingTextHandler
from snakemake_interface_logger_plugins.base import LogHandlerBase
from snakemake_interface_logger_plugins.common import LogEvent

__all__ = ["LogHandler"]

ROUTINE = (  # beginnings of messages that have no event and tell the user nothing
    "Assuming unrestricted",
    "Building DAG",
    "Conda environments",
    "Execute ",
    "Provided ",
    "Rules claiming",
    "Select jobs",
    "Using shell",
    "Using workflow specific",
)


def job_words(rule: str, wildcards: dict[str, Any]) -> str:
    """`meso_dvc`, {meso: meso12, state: 2} -> "meso DVC, meso12, state 2"."""
    name = rule.replace("_", " ").replace("dvc", "DVC")
    values = [f"state {v}" if key == "state" else str(v) for key, v in wildcards.items()]
    return ", ".join([name, *values])


def clock(seconds: float) -> str:
    """Elapsed time: "2:05", "1:02:05"."""
    minutes, rest = divmod(int(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"


class LogHandler(LogHandlerBase):
    """Snakemake's terminal handler, but for jobs that go well."""

    writes_to_stream = True
    writes_to_file = False
    has_filter = False  # that of Snakemake, which obeys --quiet
    has_formatter = False
    needs_rulegraph = False

    def __post_init__(self) -> None:
        settings = self.common_settings
        stream = sys.stdout if settings.stdout else sys.stderr
        self.terminal = ColorizingTextHandler(nocolor=settings.nocolor, stream=stream)
        self.start = time.monotonic()
        self.jobs: dict[int, str] = {}
        self.done = ""

    def emit(self, record: LogRecord) -> None:
        """Tell of a record what the terminal is to show."""
        if self.common_settings.dryrun or record.levelno >= WARNING:
            self.show(record)
            return
        event = getattr(record, "event", None)
        if event is None and not str(record.msg).startswith(ROUTINE):
            self.show(record)
        elif event == LogEvent.RUN_INFO:
            self.say(f"{record.stats['total']} jobs to do")
        elif event == LogEvent.JOB_INFO:
            self.jobs[record.jobid] = job_words(record.rule_name, dict(record.wildcards or {}))
        elif event == LogEvent.JOB_FINISHED:
            self.done = self.jobs.get(record.job_id, str(record.msg))
        elif event == LogEvent.PROGRESS:
            share = record.done / max(record.total, 1)
            self.say(f"{record.done} of {record.total} steps ({share:.0%}) done: {self.done}")

    def show(self, record: LogRecord) -> None:
        """A record as Snakemake shows it."""
        self.terminal.setFormatter(self.formatter)
        self.terminal.emit(record)

    def say(self, words: str) -> None:
        """A line of our own, with the time since the beginning."""
        print(
            f"{clock(time.monotonic() - self.start):>7}  {words}",
            file=self.terminal.stream,
            flush=True,
        )
