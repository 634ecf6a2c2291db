"""`./addvc run` tells of each job in a line, hides no error and keeps the status."""

import logging
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from addvc.runtime import job, told
from addvc.readable import fault
from snakemake_logger_plugin_addvc import clock, job_words, no_target

SOURCE = Path(__file__).parents[2] / "workflow/src"
SNAKEFILE = """
rule all:
    input: "meso12_state1.txt", "meso12_state2.txt", "bad.txt"
rule meso_dvc:
    output: "{mesh}_state{state}.txt"
    shell: "touch {output}"
rule bad:
    output: "bad.txt"
    log: "bad.log"
    shell: "echo the value, the limit and the remedy > {log}; exit 3"
"""


@pytest.fixture
def snakemake(tmp_path):
    """snakemake(words): a small workflow run with the lines of addvc in its terminal."""
    (tmp_path / "Snakefile").write_text(SNAKEFILE)

    def run(*words):
        command = [sys.executable, "-m", "snakemake", "--logger", "addvc", "--cores", "1", *words]
        env = os.environ | {"PYTHONPATH": str(SOURCE)}
        done = subprocess.run(command, cwd=tmp_path, env=env, capture_output=True, text=True)
        return done.returncode, done.stdout + done.stderr

    return run


def full_log(folder):
    [path] = folder.glob(".snakemake/log/*.log")
    return path.read_text()


def test_a_line_for_each_job_and_all_of_the_log_in_the_file(snakemake, tmp_path):
    status, said = snakemake("meso12_state1.txt", "meso12_state2.txt")
    assert status == 0
    lines = [line for line in said.splitlines() if "steps" in line]
    for count, line in enumerate(lines, start=1):
        share = 100 * count // 2
        start = rf" +0:\d\d  {count} of 2 steps \({share}%\) done: meso DVC, meso12, state [12]"
        assert re.fullmatch(start, line)
    assert len(lines) == 2 and "2 jobs to do" in said
    assert "Finished jobid" not in said and "reason:" not in said
    assert full_log(tmp_path).count("Finished jobid") == 2
    assert full_log(tmp_path).count("rule meso_dvc:") == 2


def test_a_failed_job_is_told_in_full_and_the_status_stays(snakemake, tmp_path):
    status, said = snakemake("--keep-going", "--show-failed-logs")
    assert status == 1
    assert "FAILED: bad: no error of addvc's in bad.log, which ends with:" in said
    assert "the value, the limit and the remedy" in said
    assert len(re.findall(r"of 4 steps", said)) == 2, "the others are made"
    assert "Error in rule bad" in full_log(tmp_path)


def test_a_job_that_is_killed_is_told_with_the_signal(snakemake, tmp_path):
    (tmp_path / "Snakefile").write_text(
        "rule all:\n    input: 'a'\n"
        "rule one:\n    output: 'a'\n    log: 'one.log'\n    script: 'one.py'\n"
    )
    (tmp_path / "one.py").write_text("import os\nos.kill(os.getpid(), 9)\n")
    status, said = snakemake()
    assert status == 1 and "FAILED: one: before it could write one.log" in said
    assert "a job was killed by SIGKILL" in said


def test_what_is_wrong_before_any_job_is_told(snakemake, tmp_path):
    status, said = snakemake("nothing.txt")
    assert status == 1 and "nothing.txt: nothing makes that. A target is `ablation`" in said
    assert "Abaltion: nothing makes that; did you mean ablation?" in snakemake("Abaltion")[1]
    assert "Fig15: nothing makes that; did you mean fig15?" in snakemake("Fig15")[1]
    (tmp_path / "Snakefile").write_text(
        "from snakemake.exceptions import WorkflowError\nraise WorkflowError('the remedy')\n"
    )
    status, said = snakemake()
    assert status == 1 and "the remedy" in said


def test_the_error_in_the_log_of_a_job_is_told_once(snakemake, tmp_path):
    text = SNAKEFILE.replace("echo the", "echo ERROR: the")
    (tmp_path / "Snakefile").write_text(text)
    status, said = snakemake("--keep-going", "--show-failed-logs")
    assert status == 1 and said.count("FAILED: bad: the value, the limit and the remedy\n") == 1
    assert "Error in rule" not in said and "RuleException" not in said


def test_a_fault_of_the_configuration_is_told_without_the_place_in_the_rules(snakemake, tmp_path):
    (tmp_path / "Snakefile").write_text(
        "from snakemake.exceptions import WorkflowError\n"
        "def check():\n    raise WorkflowError('Configuration of case mine: two things:\\n- a\\n- b')\n"
        "check()\n"
    )
    status, said = snakemake()
    assert status == 1 and said.endswith("Configuration of case mine: two things:\n- a\n- b\n")
    assert "Snakefile" not in said


def test_ctrl_c_ends_a_job_and_the_run_without_a_traceback(snakemake, tmp_path):
    (tmp_path / "slow.py").write_text(
        "import time\nfrom addvc.runtime import job\nopen('begun', 'w')\ntime.sleep(60)\n"
    )
    (tmp_path / "Snakefile").write_text(
        "rule slow:\n    output: 'slow.txt'\n    log: 'slow.log'\n    script: 'slow.py'\n"
    )
    command = [sys.executable, "-m", "snakemake", "--logger", "addvc", "--cores", "1"]
    env = os.environ | {"PYTHONPATH": str(SOURCE)}
    run = subprocess.Popen(
        command, cwd=tmp_path, env=env, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    while run.poll() is None and not (tmp_path / "begun").exists():
        time.sleep(0.1)
    os.killpg(run.pid, signal.SIGINT)
    said = run.communicate(timeout=60)[1]
    assert run.returncode and "interrupted" in said
    assert "Traceback" not in said and "Error in rule" not in said


def test_kill_ends_a_run_after_the_jobs_at_work(snakemake, tmp_path):
    (tmp_path / "Snakefile").write_text(
        "rule all:\n    input: 'a.txt', 'b.txt'\n"
        "rule one:\n    output: '{name}.txt'\n    shell: 'sleep 4; touch {output}'\n"
    )
    command = [
        "timeout",
        "--foreground",
        "3",
        sys.executable,
        "-m",
        "snakemake",
        "--logger",
        "addvc",
    ]
    env = os.environ | {"PYTHONPATH": str(SOURCE)}
    done = subprocess.run(
        [*command, "--cores", "1"], cwd=tmp_path, env=env, capture_output=True, text=True
    )
    assert done.stderr.count("asked to stop: ends after the jobs at work") == 1
    assert "Will exit" not in done.stderr and "Shutting" not in done.stderr
    assert len(list(tmp_path.glob("*.txt"))) == 1


@pytest.mark.parametrize("ignored", [True, False])
def test_a_signal_that_is_ignored_ends_no_job(tmp_path, ignored):
    (tmp_path / "self.py").write_text(
        "import os, signal\nfrom addvc.runtime import job\n"
        "os.kill(os.getpid(), signal.SIGINT)\nopen(snakemake.output[0], 'w').close()\n"
    )
    (tmp_path / "Snakefile").write_text("rule one:\n    output: 'one.txt'\n    script: 'self.py'\n")
    command = [sys.executable, "-m", "snakemake", "--cores", "1"]
    if ignored:
        command = ["sh", "-c", 'trap "" INT; exec "$@"', "sh", *command]
    env = os.environ | {"PYTHONPATH": str(SOURCE)}
    done = subprocess.run(command, cwd=tmp_path, env=env, capture_output=True, text=True)
    assert (done.returncode == 0) == ignored == (tmp_path / "one.txt").exists()
    assert "Traceback" not in done.stderr


def test_a_dry_run_tells_the_jobs_in_a_table_or_each_with_its_reason(snakemake):
    status, said = snakemake("-n")
    assert status == 0 and said.count("Job stats:") == 1
    assert "rule bad:" not in said
    status, said = snakemake("-n", "--verbose")
    assert "rule bad:" in said and "reason: Missing output files" in said


def test_nothing_to_be_done_is_said(snakemake):
    snakemake("meso12_state1.txt")
    assert "Nothing to be done" in snakemake("meso12_state1.txt")[1]


def test_figures_are_told_in_words():
    figures = {
        "rms": np.float32(0.123456),
        "foam": {"micro": {"valid": np.int64(7)}},
        "kind": "box",
        "best": None,
        "r": [1],
        "ended": True,
    }
    assert told(figures) == "rms 0.1235, foam.micro.valid 7, kind box, ended True"


def test_words_and_clock():
    assert job_words("micro_dvc", {"micro": "micro-eq10", "state": 3}) == (
        "micro DVC, micro-eq10, state 3"
    )
    assert [clock(s) for s in (0, 65.9, 3725)] == ["0:00", "1:05", "1:02:05"]


@pytest.mark.parametrize(("level", "shown"), [("INFO", True), ("WARNING", False), (None, True)])
def test_what_a_job_says_goes_to_its_log_and_by_choice_to_the_terminal(
    tmp_path, monkeypatch, capsys, level, shown
):
    if level:
        monkeypatch.setenv("ADDVC_LOG", level)
    else:
        monkeypatch.delenv("ADDVC_LOG", raising=False)
    path = tmp_path / "job.log"
    one = SimpleNamespace(log=[path], rule="meso_dvc", wildcards={"state": 2}, threads=1)
    with job(one) as log:
        log.info("iteration 1")
        log.warning("a tenth is missing")
    said = capsys.readouterr().err
    assert ("iteration 1" in said) == shown and "a tenth is missing" in said
    assert "[meso_dvc 2] iteration 1" in path.read_text()
    assert logging.getLogger("addvc").handlers == []


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("case: a\n\tporosity: .9\n", r"bad.yaml, line 2: this is not YAML: a tab: indent with"),
        ("case: a\nporosity .9\nscans: b\n", r"bad.yaml, lines 2 to 3: this is not YAML"),
        ("scans:\n   bin: 1\n  crop: null\n", r"bad.yaml, line 3: .*the indentation does not fit"),
        ("scans: {bin: 1\n", r"bad.yaml, lines 1 to 2: .*a bracket is opened and not closed"),
        ("scans:\n  bin: 1\n  bin: 2\n", r"bad.yaml, lines 2 to 3: `bin` is given twice: keep one"),
        ('a: "C:\\scans"\n', r"bad.yaml, line.* a backslash in double quotes: write /"),
        ("a: b\x01\n", r"bad.yaml: unacceptable character"),
        ("a: 2026-13-45\n", r"bad.yaml: month must be in"),
        ("", r"bad.yaml: has no `key: value` in it"),
    ],
)
def test_a_file_that_is_not_yaml_is_told_with_the_line(tmp_path, text, words):
    (tmp_path / "bad.yaml").write_text(text)
    assert re.search(words, fault(tmp_path / "bad.yaml"))
    (tmp_path / "bad.yaml").write_text("case: a\n")
    assert fault(tmp_path / "bad.yaml") is None


def test_what_is_made_for_each_state_is_no_target():
    words = no_target("Target rules may not contain wildcards. Please specify concrete files")
    assert words.startswith("What is made for each state") and "give its file" in words
