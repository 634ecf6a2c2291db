"""The lists of dependencies agree; `./addvc` does what its help says (no network, no set-up)."""

import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def test_conda_file_has_the_dependencies_of_pyproject():
    listed = yaml.safe_load((ROOT / "envs/addvc.yaml").read_text())["dependencies"]
    wanted = ["python" + PROJECT["requires-python"], *PROJECT["dependencies"]]
    assert {(r.name, r.specifier) for r in map(Requirement, listed)} == {
        (r.name, r.specifier) for r in map(Requirement, wanted)
    }


def test_requirements_are_the_locked_versions_of_all_that_addvc_needs():
    packages = tomllib.loads((ROOT / "uv.lock").read_text())["package"]
    needs = {}
    for p in packages:
        extras = p.get("optional-dependencies", {}).values()
        dependencies = [*p.get("dependencies", []), *(d for extra in extras for d in extra)]
        needs.setdefault(p["name"], set()).update(d["name"] for d in dependencies)
    reached, todo = set(), {"addvc"}
    while todo:
        reached |= todo
        todo = set().union(*(needs[name] for name in todo)) - reached

    lines = (ROOT / "envs/requirements.txt").read_text().splitlines()
    pinned = [Requirement(line) for line in lines if not line.startswith("#")]
    assert {(r.name, str(r.specifier)) for r in pinned} == {
        (p["name"], f"=={p['version']}") for p in packages if p["name"] in reached - {"addvc"}
    }


def test_lock_file_names_no_index_but_pypi():
    text = (ROOT / "uv.lock").read_text()
    assert set(re.findall(r'registry = "(.*?)"', text)) == {"https://pypi.org/simple"}
    assert set(re.findall(r'url = "(.*?//.*?)/', text)) == {"https://files.pythonhosted.org"}


def test_supported_pythons_in_addvc_are_those_of_pyproject():
    low, high = re.search(r"\((3, \d+)\) <= sys.version_info < \((3, \d+)\)", read_addvc()).groups()
    stated = f">={low},<{high}".replace(", ", ".")
    assert Requirement("python" + stated) == Requirement("python" + PROJECT["requires-python"])


def read_addvc():
    return (ROOT / "addvc").read_text()


# Stands in for .venv/bin/python and snakemake of a copy of addvc; writes down how it was called.
RECORDER = """#!/bin/sh
case "$*" in
    -V) echo Python 3.11.0; exit ;;
    "-m uv --version") echo "uv {uv}"; exit ;;
esac
echo "${{0##*/}} $*" >>"{calls}"
echo "threads $OPENBLAS_NUM_THREADS in $PWD" >>"{calls}"
case "$0 $*" in *" -m uv sync"*) exit {sync_status} ;; */snakemake*) exit 7 ;; esac
"""


class Copy:
    def __init__(self, folder: Path):
        folder.mkdir()
        self.folder, self.calls = folder, folder / "calls"
        shutil.copy(ROOT / "addvc", folder)
        (folder / "uv.lock").write_text("lock 1\n")
        tools = folder / "tools"  # every system package is there, and this is Debian
        for name, line in {"dpkg-query": "printf installed", "apt-get": "exit 1"}.items():
            executable(tools / name, f"#!/bin/sh\n{line}\n")
        self.path = f"{tools}:{os.environ['PATH']}"

    def python(self, sync_status: int = 0) -> None:
        uv = re.search(r"^uv=(.*)$", read_addvc(), re.MULTILINE).group(1)
        text = RECORDER.format(uv=uv, calls=self.calls, sync_status=sync_status)
        for name in ("python", "snakemake"):
            executable(self.folder / ".venv/bin" / name, text)

    def __call__(self, *words, cwd: Path | None = None, **env):
        """Run ./addvc; give its result and the calls made to the stand-in."""
        self.calls.unlink(missing_ok=True)
        kept = {k: v for k, v in os.environ.items() if k != "OPENBLAS_NUM_THREADS"}
        result = subprocess.run(
            [self.folder / "addvc", *words],
            cwd=cwd or self.folder,
            env=kept | {"PATH": self.path} | env,
            capture_output=True,
            text=True,
            timeout=60,
        )
        return result, self.calls.read_text().splitlines() if self.calls.exists() else []


def executable(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    path.chmod(0o755)


@pytest.fixture
def copy(tmp_path):
    return Copy(tmp_path / "a b")  # a space in the path, on purpose


@pytest.fixture
def ready(copy):
    copy.python()
    copy("test")
    return copy


def test_help_names_the_commands_and_sets_nothing_up(copy):
    for word in ("help", "--help", "-h"):
        result, _ = copy(word)
        assert result.returncode == 0
        assert "./addvc run" in result.stdout and "./addvc test" in result.stdout
    assert not (copy.folder / ".venv").exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "Usage:"),
        (["rum"], "addvc: rum: no such command; run, test or help?"),
        (["--cores", "1"], "addvc: --cores: no such command"),
    ],
)
def test_no_or_an_unknown_command_is_told_with_status_2(copy, words, said):
    result, _ = copy(*words)
    assert result.returncode == 2
    assert result.stdout == "" and result.stderr.startswith(said)
    assert not (copy.folder / ".venv").exists()


def test_second_call_sets_nothing_up(copy):
    copy.python()
    _, first = copy("test", "-k", "word")
    result, second = copy("test", "-k", "word")
    assert any(call.startswith("python -m uv sync --frozen") for call in first)
    assert second == ["python -m pytest -k word", f"threads 1 in {copy.folder}"]
    assert result.stderr == ""


@pytest.mark.parametrize("name", ["uv.lock", "addvc"])
def test_changed_lock_file_or_addvc_updates_the_environment_in_place(ready, name):
    kept = ready.folder / ".venv/kept"
    kept.touch()
    with open(ready.folder / name, "a") as file:
        file.write("# changed\n")
    _, calls = ready("test")
    assert any("uv sync" in call for call in calls) and kept.exists()


def test_unfinished_set_up_starts_again_from_nothing(ready):
    (ready.folder / ".venv/addvc-stamp").write_text("unfinished\n")
    executable(ready.folder / "tools/python3", "#!/bin/sh\nexit 3\n")
    for minor in (11, 12, 13):
        shutil.copy(ready.folder / "tools/python3", ready.folder / f"tools/python3.{minor}")
    result, _ = ready("test")
    assert result.returncode == 1
    assert "Python 3.11 to 3.13 is needed" in result.stderr
    assert not (ready.folder / ".venv/bin/python").exists()


def test_failed_installation_says_what_to_check_and_leaves_no_stamp(copy):
    copy.python(sync_status=2)
    result, calls = copy("run")
    assert result.returncode == 1
    assert "uv could not install the packages" in result.stderr and "HTTPS_PROXY" in result.stderr
    assert not any("snakemake" in call for call in calls)
    assert (copy.folder / ".venv/addvc-stamp").read_text() == "unfinished\n"


@pytest.mark.skipif(sys.platform != "linux", reason="Debian's tools")
def test_missing_system_packages_are_asked_for_in_one_command(copy):
    query = '#!/bin/sh\ncase "$*" in *libgl1|*libegl1) exit 1 ;; esac\nprintf installed\n'
    executable(copy.folder / "tools/dpkg-query", query)
    executable(copy.folder / "tools/id", "#!/bin/sh\necho 1000\n")
    executable(copy.folder / "tools/sudo", "#!/bin/sh\nexit 1\n")
    result, _ = copy("run")
    assert result.returncode == 1
    assert result.stderr.splitlines()[-1] == (
        "sudo apt-get update && sudo apt-get install -y --no-install-recommends libgl1 libegl1"
    )
    assert not (copy.folder / ".venv").exists()


@pytest.mark.parametrize(
    "words, given",
    [
        ("", "--cores all"),
        ("-n results/a", "--cores all -n results/a"),
        ("--config cores=3", "--cores all --config cores=3"),
        ("--cores 2", "--cores 2"),
        ("-c2", "-c2"),
        ("-j 3", "-j 3"),
        ("--workflow-profile slurm", "--workflow-profile slurm"),
        ("--executor=dryrun", "--executor=dryrun"),
    ],
)
def test_run_uses_all_cores_unless_told_and_passes_the_rest_on(ready, words, given):
    result, calls = ready("run", *words.split())
    assert calls[0] == f"snakemake --rerun-incomplete --logger=addvc {given}"
    assert result.returncode == 7  # snakemake's own


def test_another_logger_may_be_asked_for(ready):
    _, calls = ready("run", "-c1", "--logger", "rich")
    assert calls[0] == "snakemake --rerun-incomplete -c1 --logger rich"


def test_config_file_is_found_from_the_callers_folder(ready, tmp_path):
    (tmp_path / "my.yaml").touch()
    where = f"threads 1 in {ready.folder}"
    for words in (["--configfile", "my.yaml"], ["--configfile=my.yaml"]):
        _, calls = ready("run", *words, "-n", "my.yaml.html", cwd=tmp_path)
        run, checked = [call for call in calls if call != where][::-1]
        assert checked == f"python -m addvc.readable {tmp_path}/my.yaml"
        assert run.endswith(f"--configfile {tmp_path}/my.yaml -n my.yaml.html")
        assert calls.count(where) == len(calls) - 2 > 0
    (ready.folder / "config").mkdir(exist_ok=True)
    (ready.folder / "config/paper.yaml").touch()
    _, calls = ready("run", "--configfile", "config/paper.yaml", cwd=tmp_path)
    assert [call for call in calls if call != where][-1].endswith("--configfile config/paper.yaml")


def test_missing_config_file_is_named(ready, tmp_path):
    result, calls = ready("run", "--configfile", "none.yaml", cwd=tmp_path)
    assert result.returncode == 1 and not calls
    assert "none.yaml: no such configuration" in result.stderr


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("--configfile", "--configfile: of which FILE?"),
        ("--configfile -n", "--configfile: of which FILE?"),
        ("-configfile my.yaml", "-configfile: did you mean --configfile?"),
    ],
)
def test_a_configuration_that_is_not_named_is_asked_for(ready, words, said):
    result, calls = ready("run", *words.split())
    assert result.returncode == 1 and not calls
    assert said in result.stderr


def test_a_fault_of_the_default_configuration_is_told_too(ready):
    (ready.folder / "config").mkdir(exist_ok=True)
    (ready.folder / "config/config.yaml").touch()
    _, calls = ready("run", "-c1")
    assert any(call.startswith("python -m addvc.readable config/config.yaml") for call in calls)


def test_a_configuration_in_the_place_of_a_target_is_told(ready, tmp_path):
    (tmp_path / "my.yaml").touch()
    result, calls = ready("run", "my.yaml", cwd=tmp_path)
    assert result.returncode == 1 and not calls
    assert "./addvc run --configfile my.yaml" in result.stderr


def test_number_of_blas_threads_can_be_set(ready):
    _, calls = ready("test", OPENBLAS_NUM_THREADS="4")
    assert calls[1].startswith("threads 4")


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="needs /proc")
def test_lock_of_a_killed_run_is_cleared_but_not_that_of_a_live_one(ready):
    lock = ready.folder / ".snakemake/locks/0.output.lock"
    lock.parent.mkdir(parents=True)
    lock.touch()
    script = ready.folder / ".snakemake/scripts/s.py"
    script.parent.mkdir()
    script.write_text("import time; time.sleep(60)")

    orphan = subprocess.Popen([sys.executable, script], cwd=ready.folder)
    result, calls = ready("run", "-c1")
    assert "clearing the lock" in result.stderr and str(orphan.pid) in result.stderr
    assert calls[0] == "snakemake --unlock -c1"
    assert orphan.wait(10) == -15

    words = [sys.executable, "-c", "import time; time.sleep(60)", "-m", "snakemake", "--cores"]
    with subprocess.Popen(words, cwd=ready.folder) as live:
        result, calls = ready("run", "-c1")
        live.terminate()
    assert f"snakemake is at work in this folder (process {live.pid})" in result.stderr
    assert result.returncode == 1 and not calls


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="needs /proc")
def test_a_second_run_is_refused_even_where_the_lock_is_gone(ready):
    words = [sys.executable, "-c", "import time; time.sleep(60)", "-m", "snakemake", "--cores"]
    with subprocess.Popen(words, cwd=ready.folder) as live:
        refused, calls = ready("run", "-c1")
        looked, _ = ready("run", "-c1", "-n")
        at_work = [ready("run", words)[0] for words in ("-Rmicro_mesh", "-k", "-F")]
        shown = [ready("run", words)[0] for words in ("-pn", "--help", "--dag", "--dry-run")]
        live.terminate()
    assert refused.returncode == 1 and "another clone can run beside it" in refused.stderr
    assert not any("at work" in one.stderr for one in shown)
    assert all("at work" in one.stderr for one in at_work)
    assert not calls and "at work" not in looked.stderr


def test_lock_held_from_another_machine_is_left_alone(ready):
    lock = ready.folder / ".snakemake/locks/0.output.lock"
    log = ready.folder / ".snakemake/log/a.snakemake.log"
    for path in (lock, log):
        path.parent.mkdir(parents=True)
    lock.touch()
    os.utime(lock, (0, 0))
    log.write_text("SNAKEMAKE\n  Host: elsewhere\n")
    result, calls = ready("run", "-c1")
    assert "locked by a run on elsewhere" in result.stderr
    assert calls[0] == "snakemake --rerun-incomplete --logger=addvc -c1"
