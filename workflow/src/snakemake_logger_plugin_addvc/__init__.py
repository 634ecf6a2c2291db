"""A line in the terminal for each job that is done, by the logger interface of Snakemake.

`./addvc run` asks for it (`--logger addvc`). It takes the place of what Snakemake says in the terminal
about jobs that go well, about those that failed (their error, or the end of their log), and about the
place in the rules where a fault of the configuration was found. Other warnings and errors pass as they
are. A dry run shows its table of jobs (each of them with --verbose). `.snakemake/log` has everything.
It is beside `addvc`, which knows nothing of Snakemake.
"""

import re
import sys
import time
from difflib import get_close_matches
from logging import ERROR, WARNING, LogRecord
from pathlib import Path
from typing import Any

from snakemake.logging import ColorizingTextHandler
from snakemake_interface_logger_plugins.base import LogHandlerBase
from snakemake_interface_logger_plugins.common import LogEvent

from addvc.errors import error_in

__all__ = ["LogHandler"]

ROUTINE = (  # beginnings of messages that have no event and tell the user nothing
    "Assuming unrestricted",
    "Building DAG",
    "Conda environments",
    "Execute ",
    "Provided ",
    "Reasons:",
    "Rules claiming",
    "Select jobs",
    "Rules with provenance",
    "Shutting down",
    "Some jobs were triggered",
    "Using shell",
    "Using workflow specific",
)

CONFIGURATION = "Configuration of case "
"""How a message on a fault of the configuration begins (rules/common.smk)."""

STUDIES = ("ablation", "sensitivity")
"""Targets with a name that are no figures."""

CAPTIONS = Path(__file__).parents[2] / "report"
"""Figures and tables have a caption each, by their own name."""

TARGETS = (
    "A target is `ablation`, `sensitivity`, a figure or table by its name in the report (`fig06`, "
    "`table2`, `more_bending`) or a file, such as results/CASE/struts_state1.csv."
)
"""What may stand after `./addvc run`."""

STOPPING = "Terminating processes on user request"
"""How Snakemake answers Ctrl-C."""

LOCKED = "Directory cannot be locked"
"""What Snakemake says of a lock; a dry run goes on all the same."""

ENDS = "Exiting because a job execution failed"
"""What Snakemake says at the end, when each of these jobs has been told."""

ENDING = "Will exit after finishing"
"""How Snakemake answers kill."""


def fault(message: str) -> str:
    """What a message says of the configuration, without the places in the rules that it names; "" where
    it is about something else."""
    _, found, words = message.partition(CONFIGURATION)
    lines = [
        line for line in words.splitlines() if not re.match(r'  File ".*", line \d+, in ', line)
    ]
    return found + "\n".join(lines)


def no_target(message: str) -> str:
    """What to say of a target that no rule makes, from Snakemake's message; "" if that is not known."""
    if "Target rules may not contain wildcards" in message:
        return (
            "What is made for each state or mesh by itself has no name of its own: give its file."
        )
    found = re.search(r"No rule to produce (\S+)", message)
    if not found:
        return ""
    names = [*STUDIES, *(path.stem for path in CAPTIONS.glob("*.rst"))]
    if found[1] in names:
        return f"{found[1]}: this configuration has none, as without loading states or a truth."
    close = get_close_matches(found[1].lower(), names, 1)
    return f"{found[1]}: nothing makes that" + (f"; did you mean {close[0]}?" if close else ".")


def unexplained(log: str) -> str:
    """What there is to say of a failed job that has left no error of ours: the end of its log."""
    lines = Path(log).read_text().splitlines()[-8:] if Path(log).is_file() else []
    return "\n".join([f"no error of addvc's in {log}, which ends with:" if lines else
                      f"before it could write {log}; see above", *lines])  # fmt: skip


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
        self.done = self.count = ""
        self.stopped = self.shown = self.ending = False

    def emit(self, record: LogRecord) -> None:
        """Tell of a record what the terminal is to show."""
        event = getattr(record, "event", None)
        if self.stopped:
            return
        if LOCKED in str(record.msg) and self.common_settings.dryrun:
            print("A run is at work in this folder. Left to do:", file=self.terminal.stream)
        elif str(record.msg).startswith(STOPPING):
            self.stopped = True
            kept = f"{self.count} are done and kept" if self.count else "what was done is kept"
            self.say(f"interrupted: {kept}, the same command goes on from there")
        elif record.levelno >= ERROR:
            self.tell_error(record, event)
        elif record.levelno >= WARNING or self.common_settings.verbose:
            self.show(record)
        elif event is None:
            if str(record.msg).startswith(ENDING):
                self.tell_ending()
            elif not str(record.msg).startswith(ROUTINE):
                self.show(record)
        elif event == LogEvent.RUN_INFO:
            self.tell_jobs(record)
        elif event == LogEvent.JOB_INFO:
            self.jobs[record.jobid] = job_words(record.rule_name, dict(record.wildcards or {}))
        elif event == LogEvent.JOB_FINISHED:
            self.done = self.jobs.get(record.job_id, str(record.msg))
        elif event == LogEvent.PROGRESS:
            self.count = f"{record.done} of {record.total} steps"
            share = record.done / max(record.total, 1)
            self.say(f"{self.count} ({share:.0%}) done: {self.done}")

    def tell_ending(self) -> None:
        """That a run ends by kill, once."""
        if not self.ending:
            self.say(
                "asked to stop: ends after the jobs at work; the same command goes on from there"
            )
        self.ending = True

    def tell_error(self, record: LogRecord, event: LogEvent | None) -> None:
        """An error, once: of a job what it has left in its log."""
        message = str(record.msg)
        if message.startswith(ENDS) or "At least one job did not complete" in message:
            return
        if event == LogEvent.JOB_ERROR and record.log:
            said = "\n".join(filter(None, map(error_in, record.log))) or unexplained(record.log[0])
            self.say(f"FAILED: {self.jobs.get(record.jobid, record.rule_name)}: {said}")
        elif killed := re.search(r"died with <Signals\.(\w+)", message):
            self.say(f"a job was killed by {killed[1]}: by SIGKILL most often for lack of memory")
        elif words := fault(message):
            print(words, file=self.terminal.stream, flush=True)
        elif getattr(record, "exception", "") != "RuleException" or "CalledProcess" not in message:
            if words := no_target(message):
                print(words, TARGETS, file=self.terminal.stream, flush=True)
            else:
                self.show(record)

    def tell_jobs(self, record: LogRecord) -> None:
        """How many jobs there are; in a dry run, the table of them."""
        if self.common_settings.dryrun:
            if not self.shown:
                self.show(record)
            self.shown = True
        else:
            self.say(f"{record.stats['total']} jobs to do")

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
