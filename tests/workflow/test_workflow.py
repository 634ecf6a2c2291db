"""The whole workflow on a tiny twin, in a copy of the repository: results, reruns, kills, bad input."""

import json
import math
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import meshio
import numpy as np
import pytest
import yaml

pytestmark = pytest.mark.workflow

ROOT = Path(__file__).parents[2]
PARTS = ("Snakefile", "config", "envs", "profiles", "workflow")
CONFIG = "config/test.yaml"
MESO = ["meso24", "meso16", "meso12"]
MESHES = [*MESO, "micro", "micro-eq10"]
STATES = (1, 2)
LARGEST = {"median": 0.10, "p95": 0.25}  # error of micro DVC at bulk nodes, voxels

ENVIRONMENT = {key: value for key, value in os.environ.items() if key != "SNAKEMAKE_PROFILE"}
ENVIRONMENT |= {"OPENBLAS_NUM_THREADS": "1"}


def command(*arguments, config=CONFIG):
    return [sys.executable, "-m", "snakemake", *arguments, "--cores", "2", "--configfile", config]


def snakemake(place, *arguments, config=CONFIG):
    """A call of snakemake in a folder: its status, and all that it said in `stdout`."""
    return subprocess.run(
        command(*arguments, config=config),
        cwd=place,
        env=ENVIRONMENT,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=1500,
    )


def planned(place):
    """Rules that a dry run would run."""
    said = snakemake(place, "--dry-run").stdout
    if "Nothing to be done" in said:
        return set()
    table = re.search(r"^Job stats:\n.*\n-.*\n((?:\w+ +\d+\n)+)", said, re.M)
    return {line.split()[0] for line in table[1].splitlines()} - {"total", "all"}


def started(said):
    """Rules of which a job was started."""
    return set(re.findall(r"^(?:local)?rule (\w+):$", said, re.M))


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A copy of the repository, without results; with what numba has compiled, which is slow."""
    folder = tmp_path_factory.mktemp("repository")
    for part in PARTS:
        if (ROOT / part).is_dir():
            shutil.copytree(ROOT / part, folder / part)
        else:
            shutil.copy2(ROOT / part, folder / part)
    return folder


@pytest.fixture(scope="module")
def run(place):
    """The first run, up to the report."""
    start = time.perf_counter()
    done = snakemake(place)
    print(f"the workflow took {time.perf_counter() - start:.0f} s")
    assert done.returncode == 0, done.stdout[-8000:]
    return done


@pytest.fixture(scope="module")
def results(place, run):
    return place / "results/test"


@pytest.fixture(scope="module")
def summary(results):
    return json.loads((results / "summary.json").read_text())


# --------------------------------------------------------------------------- what is there


def test_the_run_closes_with_the_verdict_of_each_state(run):
    for state in STATES:
        words = rf"^  state {state} \(.*measured, .*by the platens\): converged; sigma"
        assert re.search(words, run.stdout, re.M)
    assert "open the report: xdg-open results/test/report.html" in run.stdout


def test_the_report_holds_everything_and_fetches_nothing(results):
    text = (results / "report.html").read_text()
    away = r"""["']?(?:https?:)?//"""
    tags = r"<(?:script|img|link|iframe|source|embed|object|video)\b"
    assert re.findall(rf"{tags}[^>]*?\b(?:src|href|data)\s*=\s*{away}[^>]*>", text) == []
    assert re.findall(rf"url\(\s*{away}|@import\s+{away}", text) == []
    assert "Warnings and failures" in text
    assert "align-items: flex-start" in text, "its first page can be reached in a browser"
    labels = [json.loads(found) for found in re.findall(r'"labels": (\{.*?\})', text)]
    assert len(labels) > 15 and all(len(one) == 1 for one in labels), "two may become a switch"
    for name in figures():
        assert name in text


def test_the_ends_of_the_mesh_go_with_the_platens_that_the_images_show(summary):
    for state, strain in zip(summary["states"], (0.034, 0.052), strict=True):
        assert state["platens"]["strain"] == pytest.approx(strain, abs=2e-3)
        assert state["platens"]["apart"] < 0.2


def test_what_is_in_the_fields_is_said_beside_them(results):
    said = set(json.loads((results / "fields/fields.json").read_text())["fields"])
    for path in results.glob("fields/*.vtu"):
        fields = meshio.read(path)
        assert {*fields.point_data, *fields.cell_data} <= said


def test_there_is_a_scene_and_a_series_of_each_mesh(results):
    assert 4e6 < (results / "scene.html").stat().st_size < 25e6
    states = {path.name.partition("_state")[0] for path in results.glob("fields/*.vtu")}
    assert {path.stem for path in results.glob("fields/*.pvd")} == states


def figures():
    """Names of all figures and tables in the rules."""
    rules = (ROOT / "workflow/rules/figures.smk").read_text()
    shown = re.findall(r'shown\(\s*"(.+?)"', rules)
    return shown + [f"{name}.svg" for name in re.findall(r'drawing\("(.+?)"\)', rules)]


def test_every_figure_of_the_rules_is_there(results):
    names = figures()
    assert len(names) > 15
    for name in names:
        assert (results / "figures" / name).stat().st_size > 300, name


def test_nothing_half_written_is_left(results):
    assert [path for path in results.rglob(".*") if path.is_file()] == []


@pytest.mark.parametrize("state", STATES)
@pytest.mark.parametrize("mesh", MESHES)
def test_fields_open_in_other_programs(results, summary, mesh, state):
    field = meshio.read(results / f"fields/{mesh}_state{state}.vtu")
    nodes = len(field.points)
    figures = summary["meshes"][mesh]
    assert (nodes, len(field.cells[0].data)) == (figures["nodes"], figures["cells"])
    assert field.point_data["displacement"].shape == (nodes, 3)
    assert np.isfinite(field.point_data["displacement"]).all()
    assert set(np.unique(field.point_data["valid"])) <= {0, 1}
    assert ("uncertainty" in field.point_data) == (mesh == "micro")
    valid = summary["states"][state - 1][mesh]["valid_nodes"]
    assert field.point_data["valid"].mean() == pytest.approx(valid)
    strain = field.cell_data["strain"][0].reshape(-1, 3, 3)
    assert np.isfinite(strain).all()
    np.testing.assert_array_equal(strain, strain.transpose(0, 2, 1))


def test_the_summary_has_the_names_that_others_rely_on(summary):
    assert set(summary) >= {"case", "cell_size", "threshold", "porosity", "voxel_size_um",
                            "meshes", "states", "cost", "versions"}  # fmt: skip
    assert list(summary["meshes"]) == MESHES
    for mesh in MESHES:
        assert set(summary["meshes"][mesh]) >= {"nodes", "cells", "mean_volume", "ultimate_error"}
    assert [state["state"] for state in summary["states"]] == list(STATES)
    for state in summary["states"]:
        assert set(state) >= {"state", "strain", "verdict", "struts", *MESHES}
        for mesh in MESHES:
            assert set(state[mesh]) >= {"converged", "iterations", "residual_std", "error"}
            assert set(state[mesh]["error"]) >= {"rms", "median", "p95", "rms_normal", "rms_along"}
    for rule in ("volume", "micro_mesh", "micro_dvc"):
        assert set(summary["cost"][rule]) >= {"cpu_s", "wall_s", "max_rss_mb"}
    assert {"addvc", "python", "snakemake", "numpy"} <= set(summary["versions"])


# -------------------------------------------------------------------------------- how good


def test_the_twin_is_what_it_claims_to_be(results, summary):
    checks = json.loads((results / "analysis/twin_check.json").read_text())["checks"]
    assert [check for check in checks if not check["passed"]] == []
    assert summary["twin_checks"] == {"count": len(checks), "failed": []}
    assert len(checks) >= 8 + 3 * len(STATES)  # geometry and mechanics; then each state


def test_the_topology_of_the_mesh_is_counted_where_it_is_listed(results, summary):
    found = json.loads((results / "geometry/topology.json").read_text())
    assert summary["topology"] == found["counts"]
    assert found["counts"]["stubs"] == len(found["stubs"])
    assert found["counts"]["contacts"] == len(found["contacts"])


def test_studies_start_from_what_the_main_run_has_made(place, run):
    rules = started(snakemake(place, "ablation", "sensitivity", "--dry-run").stdout)
    assert {"variant_dvc", "variant", "more_ablation", "more_sensitivity"} <= rules
    own = {"varied_threshold", "ablation", "sensitivity", "more_ablation", "more_sensitivity"}
    assert {name for name in rules - own if not name.startswith("variant")} == set()


def test_the_twin_is_measured_as_it_was_made(summary):
    assert summary["case"] == "test"
    assert summary["cell_size"] == pytest.approx(28, rel=0.1)
    assert summary["porosity"] == pytest.approx(0.96, abs=0.002)
    assert summary["voxel_size_um"] == pytest.approx(20.01)
    for state, nominal in zip(summary["states"], (0.034, 0.052), strict=True):
        assert state["strain"] == pytest.approx(nominal, rel=0.2)


def test_every_finer_mesh_has_a_smaller_residual(summary):
    for state in summary["states"]:
        sigma = [state[mesh]["residual_std"] for mesh in (*MESO, "micro")]
        assert sigma == sorted(sigma, reverse=True) and len(set(sigma)) == len(sigma)


def test_micro_dvc_converges(summary):
    for state in summary["states"]:
        assert state["micro"]["converged"] and state["verdict"] == "converged"
        assert state["micro"]["valid_nodes"] >= 0.95


@pytest.mark.parametrize("figure", LARGEST)
def test_error_of_micro_dvc(summary, figure):
    """Below what was asked for, and below that of Eq. 10 and of every meso mesh."""
    for state in summary["states"]:
        micro, *others = (state[mesh]["error"][figure] for mesh in ("micro", "micro-eq10", *MESO))
        assert micro <= LARGEST[figure]
        assert micro < min(others)


def test_equilibrium_takes_error_off_the_finest_meso_mesh(results, summary):
    """As the images foresee, which know no truth: the risk is less too."""
    name = f"{MESO[-1]}-network"
    assert summary["results"] == [*MESO, name, *MESHES[len(MESO) :]]
    for state in summary["states"]:
        network, meso = (state[mesh]["error"]["rms"] for mesh in (name, MESO[-1]))
        assert state[name]["refused"] is None and network < 0.9 * meso
        with h5py.File(results / f"dvc/{name}_state{state['state']}.h5") as file:
            notes = json.loads(file.attrs["notes"])
        assert notes["least"] < notes["before"]


# ---------------------------------------------------------------------------------- reruns


def test_a_second_run_does_nothing(place, results):
    again = snakemake(place)
    assert again.returncode == 0
    assert "Nothing to be done" in again.stdout


@pytest.fixture
def changing(place):
    """changing(name): a file of the copy's workflow, put back with its time after the test."""
    kept = {}

    def change(name):
        path = place / "workflow" / name
        kept[path] = path.read_bytes(), path.stat()
        return path

    yield change
    for path, (content, was) in kept.items():
        path.write_bytes(content)
        os.utime(path, ns=(was.st_atime_ns, was.st_mtime_ns))


@pytest.mark.parametrize(
    "name", ["src/addvc/correlation/gauss_newton.py", "scripts/analysis/summary.py"]
)
def test_a_touch_makes_nothing_again(place, results, changing, name):
    os.utime(changing(name))
    assert planned(place) == set()


def append_comment(path):
    path.write_text(path.read_text() + "# changed\n")


def test_an_edit_makes_again_what_uses_the_module_and_what_follows(place, summary, changing):
    append_comment(changing("src/addvc/analysis/summary.py"))
    plan = planned(place)
    after = {"summary", "front_page", "report", "verdicts"}
    assert plan >= after
    assert plan.isdisjoint(set(summary["cost"]) - after), "nothing that was made before the summary"


def test_an_edit_makes_nothing_again_that_comes_before(place, results, changing):
    """Meso DVC takes the noise of the void, which the threshold tells from solid."""
    append_comment(changing("src/addvc/geometry/threshold.py"))
    plan = planned(place)
    assert plan >= {"threshold", "meso_dvc", "micro_mesh", "factor", "micro_dvc", "residual"}
    before = {"twin_scan", "check_input", "volume", "smooth", "specimen", "cell_size", "meso_mesh"}
    assert plan.isdisjoint(before | {"start", "best_start", "freeform"})


# ------------------------------------------------------------------------------- bad input


def bad_case(place, name, **changes):
    """Writes a configuration of small scans with some changes, and gives its path."""
    scans = {"reference": "scans/good.npy", "states": ["scans/good.npy"], "voxel_size_um": 20.01}
    scans |= changes.pop("scans", {})
    path = place / f"config/{name}.yaml"
    path.write_text(yaml.safe_dump({"case": name, "scans": scans, "porosity": 0.96} | changes))
    (place / "scans").mkdir(exist_ok=True)
    return str(path.relative_to(place))


def save(place, name, volume):
    (place / "scans").mkdir(exist_ok=True)
    np.save(place / "scans" / name, volume)


def refused(done, *words):
    """Status 1, all the words, no traceback, and no job of the correlation."""
    assert done.returncode == 1
    said = " ".join(done.stdout.split())
    for word in words:
        assert word in said, done.stdout[-4000:]
    assert "Traceback" not in said
    assert started(done.stdout).isdisjoint({"meso_dvc", "factor", "micro_dvc"})


def test_a_misspelt_key(place):
    done = snakemake(place, config=bad_case(place, "misspelt", porosty=0.9))
    refused(done, "Configuration of case misspelt", "unknown key `porosty`",
            "did you mean `porosity`?")  # fmt: skip
    assert started(done.stdout) == set()


def test_a_missing_scan(place):
    config = bad_case(place, "missing", scans={"states": ["scans/nowhere.tif"]})
    save(place, "good.npy", np.zeros((24, 24, 24), np.uint8))
    done = snakemake(place, config=config)
    refused(done, "scan scans/nowhere.tif was not found (0 files; at least 1)",
            "correct scans.reference or scans.states")  # fmt: skip
    assert started(done.stdout) == set()


def test_a_raw_scan_of_the_wrong_size(place):
    scans = {"reference": "scans/a.raw", "states": [], "shape": [40, 42, 44], "dtype": "uint16"}
    config = bad_case(place, "raw", scans=scans)
    (place / "scans/a.raw").write_bytes(bytes(40 * 42 * 44))
    done = snakemake(place, config=config)
    refused(done, "scans/a.raw: expected 147840 bytes", "found 73920", "correct scans.shape",
            "the size would fit dtype uint8", "Configuration of case raw")  # fmt: skip
    assert started(done.stdout) == set()


def test_a_dry_run_tells_all_that_is_wrong_with_the_scans(place):
    scans = {"reference": "scans/nowhere.tif", "states": ["scans/short.npy", "scans/good.npy"]}
    config = bad_case(place, "dry", scans=scans)
    (place / "scans/short.npy").write_bytes(b"")
    save(place, "good.npy", np.zeros((24, 24, 24), np.uint8))
    done = snakemake(place, "--dry-run", config=config)
    refused(done, "2 things are wrong with the scans", "scan scans/nowhere.tif was not found",
            "scans/short.npy: not a readable .npy array")  # fmt: skip
    assert "good.npy" not in done.stdout


def test_scans_that_are_no_images(place):
    """Both are told of in one run: a stage that fails does not keep others from being made."""
    holes = np.random.default_rng(2417).random((24, 26, 28), dtype=np.float32)
    holes[5, 6, 7] = np.nan
    save(place, "holes.npy", holes)
    save(place, "flat.npy", np.full((24, 26, 28), 7, np.float32))
    scans = {"reference": "scans/holes.npy", "states": ["scans/flat.npy"], "axes": "xyz"}
    done = snakemake(place, config=bad_case(place, "noimage", scans=scans))
    refused(done, "scans/holes.npy: 1 voxels are NaN or infinite", "(x, y, z) = (5, 6, 7)",
            "crop them away (scans.crop), or replace them", "scans/flat.npy: every voxel is 7.0",
            "an image with structure is needed")  # fmt: skip


def test_a_porosity_that_no_threshold_gives(place, results):
    """The reference of the twin, with two thirds of its volume said to be solid."""
    rest, loaded = sorted(
        str(path.relative_to(place)) for path in place.glob("results/.twins/*/scans/state[01].tif")
    )
    scans = {"reference": rest, "states": [loaded], "bin": 2, "axes": "zyx"}
    config = bad_case(place, "solid", scans=scans, porosity=0.35)
    done = snakemake(place, "results/solid/dvc/micro_factor.h5", config=config)
    refused(done, "[threshold] ERROR: the threshold", "within 2 standard deviations of the void",
            "raise porosity, or give geometry.threshold")  # fmt: skip
    assert not (place / "results/solid/geometry/micro.vtu").exists()


def test_another_voxel_size_remakes_no_volume_and_hides_no_other_change(place):
    """A check of the scans that is done again must not keep what comes after it from being seen."""
    volume = np.random.default_rng(2417).integers(0, 255, (24, 24, 24), dtype=np.uint8)
    save(place, "rest.npy", volume)
    save(place, "load.npy", volume[::-1])
    scans = {"reference": "scans/rest.npy", "states": ["scans/load.npy"]}
    targets = [f"results/size/{name}" for name in ("volumes/smooth0.h5", "input.json")]
    config = bad_case(place, "size", scans=scans)
    done = snakemake(place, *targets, config=config)
    assert done.returncode == 0, done.stdout[-4000:]

    config = bad_case(place, "size", scans=scans | {"voxel_size_um": 18.0})
    assert started(snakemake(place, "--dry-run", *targets, config=config).stdout) == {"check_input"}
    config = bad_case(place, "size", scans=scans | {"voxel_size_um": 18.0}, images={"blur": 1.0})
    plan = started(snakemake(place, "--dry-run", *targets, config=config).stdout)
    assert plan == {"check_input", "smooth"}


# ----------------------------------------------------------------------------------- kills


def begun(log, process):
    """Waits until a job is at work; fails when the run ends before."""
    for _ in range(600):
        if started(log.read_text()) & {"meso_dvc", "micro_dvc"}:
            return
        assert process.poll() is None, log.read_text()[-4000:]
        time.sleep(0.1)
    pytest.fail(f"no job began in a minute: {log.read_text()[-4000:]}")


def numbers(value, path=""):
    """Every number and word that was measured, by its path; costs and times are not."""
    if isinstance(value, dict):
        for key, item in value.items():
            if key not in ("cost", "seconds", "versions"):
                yield from numbers(item, f"{path}/{key}")
    elif isinstance(value, list):
        for place_, item in enumerate(value):
            yield from numbers(item, f"{path}/{place_}")
    else:
        yield path, value


def test_a_killed_run_goes_on_to_the_same_result(place, results, summary, tmp_path):
    goal = "results/test/summary.json"
    for name in ("dvc/micro_state1.h5", "dvc/meso12_state2.h5", "summary.json"):
        (results / name).unlink()
    log = tmp_path / "killed.txt"
    with log.open("w") as file:
        killed = subprocess.Popen(
            command(goal), cwd=place, env=ENVIRONMENT, stdout=file, stderr=file,
            start_new_session=True,
        )  # fmt: skip
    try:
        begun(log, killed)
        time.sleep(1.0)
    finally:
        os.killpg(killed.pid, signal.SIGKILL)
    assert killed.wait() == -signal.SIGKILL
    assert list((place / ".snakemake/locks").glob("*.lock"))
    assert not (results / "summary.json").exists()

    assert snakemake(place, "--unlock").returncode == 0
    done = snakemake(place, goal, "--rerun-incomplete")
    assert done.returncode == 0, done.stdout[-8000:]
    assert started(done.stdout) >= {"meso_dvc", "micro_dvc", "residual", "summary"}
    assert started(done.stdout).isdisjoint({"volume", "threshold", "micro_mesh", "best_start"})

    before = dict(numbers(summary))
    after = dict(numbers(json.loads((results / "summary.json").read_text())))
    assert set(after) == set(before)
    for path, value in before.items():
        if isinstance(value, float):
            assert math.isclose(after[path], value, rel_tol=1e-9), path
        else:
            assert after[path] == value, path
