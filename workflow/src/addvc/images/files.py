"""Files on disk: whole or not there at all."""

import json
import math
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from uuid import uuid4


@contextmanager
def atomic_path(path: str | os.PathLike) -> Iterator[Path]:
    """Yield a temporary path beside `path`, with its suffix, renamed to it on success.

    The folder is made when missing. If the block raises, the temporary file is removed and
    whatever was at `path` stays as it was.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.stem}.{uuid4().hex[:12]}{path.suffix}")
    try:
        yield temporary
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def write_json(path: str | Path, data: object) -> None:
    """JSON with two-space indents, written to a temporary name and then renamed; nan is null."""
    with atomic_path(path) as temporary:
        text = json.dumps(_known(data), indent=2, allow_nan=False)
        Path(temporary).write_text(text + "\n")


def read_json(path: str | Path) -> dict:
    """The content of a JSON file."""
    return json.loads(Path(path).read_text())


def _known(value: object) -> object:
    """Data as JSON has it: numpy scalars and arrays as numbers and lists, nan and inf as null."""
    if isinstance(value, dict):
        return {key: _known(item) for key, item in value.items()}
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, list | tuple):
        return [_known(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
