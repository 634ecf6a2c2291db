"""Files on disk: whole or not there at all."""

import json
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
    """JSON with two-space indents, written to a temporary name and then renamed."""
    with atomic_path(path) as temporary:
        Path(temporary).write_text(json.dumps(data, indent=2, default=_plain) + "\n")


def read_json(path: str | Path) -> dict:
    """The content of a JSON file."""
    return json.loads(Path(path).read_text())


def _plain(value: object) -> object:
    """numpy scalars and arrays as JSON knows them."""
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} cannot be written as JSON")
