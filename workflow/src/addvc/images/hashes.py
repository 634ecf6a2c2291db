"""What input files hold, in a number that no other file has."""

import hashlib
from collections.abc import Iterable
from pathlib import Path

from addvc.errors import ScanError

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


def check_different(hashes: dict[str, str]) -> None:
    """ScanError where two scans (path -> hash) hold the same bytes: no load was between them."""
    known: dict[str, str] = {}
    for path, found in hashes.items():
        if found in known:
            raise ScanError(
                f"{path} and {known[found]} hold the same bytes (SHA-256 {found[:12]}): one is a copy "
                "of the other under another name; correct scans.reference or scans.states"
            )
        known[found] = path
