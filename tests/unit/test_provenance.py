"""The hash of a script: an edit anywhere it depends on changes it, nothing else does."""

import importlib.util
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

WORKFLOW = Path(__file__).parents[2] / "workflow"


@pytest.fixture
def tree(tmp_path):
    """A copy of scripts and package."""
    for part in ("scripts", "src/addvc"):
        shutil.copytree(
            WORKFLOW / part, tmp_path / part, ignore=shutil.ignore_patterns("__pycache__")
        )
    return tmp_path


def provenance(tree):
    """The module as a new process sees it: the one of the copy, nothing remembered."""
    path = tree / "src/addvc/provenance.py"
    spec = importlib.util.spec_from_file_location("provenance_of_the_copy", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def hashes(tree):
    """Hash of every script, by `stage/name`."""
    code_hash = provenance(tree).code_hash
    folder = tree / "scripts"
    paths = sorted(folder.rglob("*.py"))
    return {str(path.relative_to(folder).with_suffix("")): code_hash(path) for path in paths}


def append(path, text="# changed\n"):
    path.write_text(path.read_text() + text)


def changed_by(tree, name):
    """Scripts whose hash an edit of a file of the copy changes."""
    before = hashes(tree)
    append(tree / name)
    return {script for script, value in hashes(tree).items() if value != before[script]}


def test_an_edit_changes_what_imports_the_module(tree):
    changed = changed_by(tree, "src/addvc/geometry/threshold.py")
    assert "geometry/threshold" in changed
    assert not changed & {"scans/volume", "scans/smooth", "meso/meso_dvc", "micro/micro_dvc"}


def test_an_edit_changes_what_imports_the_module_through_others(tree):
    """register imports metric; micro_dvc imports register."""
    changed = changed_by(tree, "src/addvc/correlation/metric.py")
    assert changed >= {"micro/micro_dvc", "meso/meso_dvc", "meso/start", "analysis/residual"}
    assert not changed & {"scans/volume", "geometry/threshold", "twin/twin_scan", "micro/transfer"}


def test_relative_imports_count(tree):
    changed = changed_by(tree, "src/addvc/twin/kernels.py")
    assert changed == {"twin/twin_foam", "twin/twin_mechanics", "twin/twin_scan",
                       "twin/virtual_field", "twin/virtual_scan", "analysis/truth_error",
                       "analysis/difficulty", "analysis/struts_truth", "analysis/cells_truth",
                       "analysis/uncertainty_truth",
                       "analysis/twin_check"}  # fmt: skip


def test_an_edit_of_a_script_changes_that_script_only(tree):
    assert changed_by(tree, "scripts/micro/factor.py") == {"micro/factor"}


def test_the_package_itself_is_part_of_everything(tree):
    assert changed_by(tree, "src/addvc/__init__.py") == set(hashes(tree))


def test_a_module_that_no_script_uses_changes_nothing(tree):
    (tree / "src/addvc/fem/new.py").write_text("x = 1\n")
    assert changed_by(tree, "src/addvc/fem/new.py") == set()


def test_a_new_import_changes_the_hash_from_then_on(tree):
    (tree / "src/addvc/fem/new.py").write_text("x = 1\n")
    append(tree / "scripts/scans/volume.py", "from addvc.fem import new\n")
    assert changed_by(tree, "src/addvc/fem/new.py") == {"scans/volume"}


def test_a_touch_changes_nothing(tree):
    before = hashes(tree)
    for path in tree.rglob("*.py"):
        os.utime(path)
    assert hashes(tree) == before


def test_the_place_of_the_repository_does_not_matter(tree):
    assert hashes(tree) == hashes(WORKFLOW)


def test_the_hash_of_a_folder_is_that_of_names_and_contents(tree):
    folder_hash = provenance(tree).folder_hash
    seen = [folder_hash(tree)]
    (tree / "src/addvc/fem/new.py").write_text("x = 1\n")
    seen.append(folder_hash(tree))
    (tree / "src/addvc/fem/new.py").rename(tree / "src/addvc/fem/other.py")
    seen.append(folder_hash(tree))
    append(tree / "scripts/micro/factor.py")
    seen.append(folder_hash(tree))
    assert len(set(seen)) == 4
    (tree / "notes.txt").touch()
    for path in tree.rglob("*.py"):
        os.utime(path)
    assert folder_hash(tree) == seen[-1]


LOADED = """
import ast, sys
from pathlib import Path
for path in sys.argv[1:]:
    for name in [name for name in sys.modules if name.split(".")[0] == "addvc"]:
        del sys.modules[name]
    body = ast.parse(Path(path).read_text()).body
    imports = [node for node in body if isinstance(node, ast.Import | ast.ImportFrom)]
    exec(compile(ast.Module(imports, []), path, "exec"))
    files = [m.__file__ for name, m in sys.modules.items() if name.split(".")[0] == "addvc"]
    print(path, *files)
"""


def test_all_that_python_loads_for_a_script_is_in_its_hash():
    names = ("scans/volume", "twin/twin_scan", "meso/best_start", "micro/factor",
             "analysis/truth_error", "analysis/summary", "figures/fig15", "report/verdicts")  # fmt: skip
    paths = [str(WORKFLOW / "scripts" / f"{name}.py") for name in names]
    found = subprocess.run(
        [sys.executable, "-c", LOADED, *paths],
        env=os.environ | {"PYTHONPATH": str(WORKFLOW / "src")},
        capture_output=True,
        text=True,
        check=True,
    )
    closure = provenance(WORKFLOW).closure
    for line in found.stdout.splitlines():
        script, *loaded = map(Path, line.split())
        assert len(loaded) > 3
        assert set(loaded) <= closure(script)
