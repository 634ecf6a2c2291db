"""Which code a script depends on: so that an edit reruns what uses it, and a touch nothing."""

import ast
import hashlib
import subprocess
from functools import cache
from pathlib import Path

PACKAGE = Path(__file__).parent


@cache
def imported_modules(path: Path) -> set[Path]:
    """Files of this package that a Python file imports, at any depth of its syntax."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom):
            base = _absolute(path, node)
            names.add(base)
            names.update(f"{base}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
    return {file for name in names if name.split(".")[0] == "addvc" for file in _files(name)}


def _absolute(path: Path, node: ast.ImportFrom) -> str:
    """The module a `from` import names, relative ones included."""
    if not node.level:
        return node.module or ""
    folder = path.parents[node.level - 1].relative_to(PACKAGE.parent)
    return ".".join([*folder.parts, *([node.module] if node.module else [])])


def _files(name: str) -> list[Path]:
    """The file of a module, and the `__init__` of each package on the way to it."""
    parts = name.split(".")[1:]
    found = []
    for depth in range(len(parts) + 1):
        stem = PACKAGE.joinpath(*parts[:depth])
        candidates = stem / "__init__.py", stem.with_suffix(".py")
        found += [file for file in candidates if file.is_file()]
    return found


@cache
def closure(path: Path) -> frozenset[Path]:
    """All files of this package that a file needs, itself included."""
    known, todo = {path}, [path]
    while todo:
        for file in imported_modules(todo.pop()) - known:
            known.add(file)
            todo.append(file)
    return frozenset(known)


@cache
def code_hash(script: str | Path) -> str:
    """Hash of the bytes of a script and of every module of the package that it uses."""
    digest = hashlib.sha256()
    for file in sorted(closure(Path(script).resolve())):
        digest.update(file.read_bytes())
    return digest.hexdigest()[:16]


def folder_hash(folder: Path, suffixes: tuple[str, ...] = (".py", ".smk", ".yaml")) -> str:
    """Hash of all files of a folder with these suffixes, names included: for what runs a workflow as a
    whole."""
    digest = hashlib.sha256()
    for file in sorted(path for path in folder.rglob("*") if path.suffix in suffixes):
        digest.update(str(file.relative_to(folder)).encode() + b"\0" + file.read_bytes())
    return digest.hexdigest()[:16]


def commit(folder: Path = PACKAGE) -> str:
    """The commit that a folder of a Git repository is at, with "-dirty" when files of it have been
    changed since; "unknown" where there is no repository, or no git."""
    command = ["git", "-C", str(folder), "describe", "--always", "--dirty", "--exclude=*"]
    try:
        done = subprocess.run([*command, "--abbrev=40"], capture_output=True, text=True, timeout=30)
    except (OSError, subprocess.TimeoutExpired):
        return "unknown"
    return done.stdout.strip() if done.returncode == 0 else "unknown"
