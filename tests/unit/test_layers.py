"""An import only goes to the left; scripts are thin; every rule has all that a scheduler needs."""

import ast
import re
from pathlib import Path

import pytest

from addvc.provenance import closure

WORKFLOW = Path(__file__).parents[2] / "workflow"
PACKAGE = WORKFLOW / "src" / "addvc"
SCRIPTS = sorted((WORKFLOW / "scripts").rglob("*.py"))

ORDER = ["images", "fem", "geometry", "correlation", "analysis", "report"]
TRUTHS = {PACKAGE / "analysis/truth.py", PACKAGE / "analysis/mesh_truth.py"}
FREE = {"errors", "config"}
MAY_IMPORT = {name: {*ORDER[: n + 1], *FREE} for n, name in enumerate(ORDER)}
MAY_IMPORT["twin"] = {"twin", "images", "fem", "errors", "config"}
TOP = {path.stem for path in PACKAGE.glob("*.py")}
NUMERICS = {"numpy", "scipy", "numba", "skimage", "matplotlib", "pyvista", "meshio"}

NEEDED = {"output", "log", "benchmark", "conda", "threads", "resources", "params", "script"}
WITHOUT_SCRIPT = {"all", "figures", "ablation", "sensitivity"}

JUDGES = {
    "analysis/truth.py",
    "analysis/twin_check.py",
    "analysis/struts_truth.py",
}  # modules that may import the twin
JUDGING = {
    "truth_error",
    "struts_truth",
    "uncertainty_truth",
    "cells_truth",
    "difficulty",
    "twin_check",
}  # rules and scripts that may read its truth


def imported(path):
    """Dotted names that a file imports, at any depth of its syntax, relative ones resolved."""
    parts = (
        path.relative_to(PACKAGE.parent).with_suffix("").parts if PACKAGE in path.parents else ()
    )
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = [*parts[: -node.level]] if node.level else []
            base += [node.module] if node.module else []
            yield from (".".join([*base, alias.name]) for alias in node.names)


def inside_addvc(path):
    """The imports that are modules or folders of addvc, without the leading `addvc.`."""
    names = {name.removeprefix("addvc.") for name in imported(path) if name.startswith("addvc.")}
    modules = {file.stem for file in PACKAGE.iterdir()}
    return {name for name in names if name.split(".")[0] in modules}


def files():
    """Modules of the folders of the package, by their path in it."""
    return {str(path.relative_to(PACKAGE)): path for path in sorted(PACKAGE.glob("*/*.py"))}


def rules():
    """Name -> (file, directives by name) of every rule in workflow/rules."""
    found = {}
    for path in sorted((WORKFLOW / "rules").glob("*.smk")):
        text = path.read_text()
        for head in re.finditer(r"^( *)(?:rule|checkpoint) (\w+):\n", text, re.M):
            body = re.match(rf"(?:{head[1]}    .*\n|\n)*", text[head.end() :])[0]
            parts = re.split(rf"^{head[1]}    (\w+):", body, flags=re.M)[1:]
            found[head[2]] = path.stem, dict(zip(parts[::2], parts[1::2], strict=True))
    return found


RULES = rules()
MAKING = {name: rule for name, rule in RULES.items() if name not in WITHOUT_SCRIPT}


# ---------------------------------------------------------------------------------- package


def test_every_folder_of_the_package_has_its_place_in_the_order():
    folders = {path.parent.name for path in PACKAGE.glob("*/__init__.py")}
    assert folders == set(MAY_IMPORT)


def test_an_import_only_goes_to_the_left():
    wrong = [
        f"{name} imports addvc.{target}"
        for name, path in files().items()
        for target in sorted(inside_addvc(path))
        if target.split(".")[0] not in MAY_IMPORT[path.parent.name]
        and not (name in JUDGES and target.split(".")[0] == "twin")
    ]
    assert wrong == []


def test_each_folder_says_what_it_may_import():
    for folder, allowed in MAY_IMPORT.items():
        words = ast.get_docstring(ast.parse((PACKAGE / folder / "__init__.py").read_text()))
        sentence = re.search(r"May import ([^.]*) only\b", words)[1]
        assert set(re.findall(r"`(\w+)`", sentence)) == allowed - {folder}, folder


def test_the_modules_that_rules_load_need_no_numerics():
    """They are loaded anew for each job; readme.py alone is for us."""
    for path in sorted(PACKAGE.glob("*.py")):
        needed = {name.split(".")[0] for name in imported(path)}
        inside = {name.split(".")[0] for name in inside_addvc(path)}
        assert not needed & NUMERICS, path.name
        assert inside <= TOP or path.name == "readme.py", path.name


def test_only_judges_know_the_truth():
    knowing = {
        name
        for name, path in files().items()
        if path.parent.name != "twin"
        and any(target.split(".")[0] == "twin" for target in inside_addvc(path))
    }
    assert knowing == JUDGES


def test_nothing_that_measures_depends_on_the_truth():
    """Not even through other modules: the scripts of all stages but the twin's and the judging ones."""
    measuring = [path for path in SCRIPTS if path.parent.name not in ("twin", "figures", "report")]
    measuring = [path for path in measuring if path.stem not in JUDGING]
    wrong = [
        f"{path.stem} depends on {file.relative_to(PACKAGE)}"
        for path in measuring
        for file in closure(path)
        if file.parent.name == "twin" or file in TRUTHS
    ]
    assert len(measuring) > 20
    assert wrong == []


def test_only_judging_rules_read_the_truth():
    reading = {
        name
        for name, (stage, parts) in MAKING.items()
        if stage != "twin" and re.search(r"\bTRUTH\b", parts.get("input", ""))
    }
    assert reading == JUDGING


def test_no_module_imports_snakemake():
    importing = [
        str(path.relative_to(PACKAGE))
        for path in PACKAGE.rglob("*.py")
        if any(name.split(".")[0] == "snakemake" for name in imported(path))
    ]
    assert importing == []


# ---------------------------------------------------------------------------------- scripts


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_a_script_is_thin_and_a_job(path):
    text = path.read_text()
    jobs = [
        item.context_expr
        for node in ast.parse(text).body
        if isinstance(node, ast.With)
        for item in node.items
    ]
    assert len(text.splitlines()) <= 30
    assert [ast.unparse(call) for call in jobs] == ["job(snakemake)"]
    assert ast.get_docstring(ast.parse(text)), "a script says what its rule makes"


def test_every_script_belongs_to_one_rule():
    used = [re.search(r'"\.\./scripts/(.+?)"', parts["script"])[1] for _, parts in MAKING.values()]
    assert sorted(used) == [str(path.relative_to(WORKFLOW / "scripts")) for path in SCRIPTS]


# ------------------------------------------------------------------------------------ rules


def test_rules_without_a_script_only_gather():
    gathering = WITHOUT_SCRIPT - {"all"}  # which is in the Snakefile
    assert set(RULES) & WITHOUT_SCRIPT == gathering
    assert all(set(RULES[name][1]) == {"input"} for name in gathering)


def test_a_rule_made_from_another_has_output_log_and_benchmark_of_its_own():
    made = [
        (name, body)
        for path in (WORKFLOW / "rules").glob("*.smk")
        for name, body in re.findall(
            r"^ *use rule \w+ as (\w+) with:\n((?:.+\n|\n(?! *(?:rule|use|if|def)\b))+)",
            path.read_text(),
            re.M,
        )
    ]
    places = {kind: [re.search(rf"{kind}:\s+f?\"(.+?)\"", body)[1] for _, body in made]
              for kind in ("log", "benchmark")}  # fmt: skip
    written = "".join(path.read_text() for path in (WORKFLOW / "rules").glob("*.smk"))
    assert len(made) == len(re.findall(r"^ *use rule ", written, re.M)) > 0
    assert all("output:" in body for _, body in made)
    for found in places.values():
        assert len(set(found)) == len(found)


@pytest.mark.parametrize("name", MAKING)
def test_a_rule_says_what_a_scheduler_needs(name):
    stage, parts = MAKING[name]
    assert set(parts) >= NEEDED
    assert re.search(r"\bmem_mb=", parts["resources"])
    assert re.search(r"\bruntime=\d+", parts["resources"])
    assert re.search(r"^\s*(ENV|\S*envs/addvc\.yaml\S*)\s*$", parts["conda"])
    assert re.fullmatch(r"\s*\S.*\s*", parts["threads"])

    script = re.search(r'"\.\./scripts/(.+?)"', parts["script"])[1]
    assert re.search(r'\bcode=code\("(.+?)"\)', parts["params"])[1] == script
    folder, file = script.removesuffix(".py").split("/")
    assert folder == stage
    assert file in (name, name.removeprefix(f"{stage}_")), "a script is named for its rule"


@pytest.mark.parametrize("name", MAKING)
def test_log_and_benchmark_of_a_rule_are_its_own(name):
    for kind in ("log", "benchmark"):
        mine = re.search(r'"(.+?)"', MAKING[name][1][kind])[1]
        stem = f"/figures/{name}." if MAKING[name][0] == "figures" else f"/{name}/"
        assert stem in mine
