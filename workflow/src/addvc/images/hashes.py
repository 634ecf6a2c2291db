"""What input files hold, in a number that no other file has."""

import hashlib
from collections.abc import Iterable
from pathlib import Path

BLOCK = 2**22


def content_hash(files: Iterable[str | Path]) -> str:
    """SHA-256 (hexadecimal) of the bytes of files, one after the other; of one file, what `sha256sum`
    prints."""
    digest = hashlib.sha256()
    for name in files:
        with Path(name).open("rb") as file:
            while block := file.read(BLOCK):
                digest.update(block)
    return digest.hexdigest()
