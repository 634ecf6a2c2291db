"""Tables as CSV, and the same in markdown between marks of README.md."""

import csv
from collections.abc import Sequence
from pathlib import Path

from addvc.images.files import atomic_path
from addvc.readme import table, write_filled

DIGITS = {"cpu_s": 0, "cpu_ratio": 2, "within_1_voxel": 4, "count": 0}
"""Decimal places of columns that differ from three."""


def best_of(rows: Sequence[dict]) -> dict:
    """The row with the least rms error: a peer is shown by its best settings."""
    return min(rows, key=lambda row: row["rms"])


def with_ratio(rows: Sequence[dict], unit: str) -> list[dict]:
    """Rows with their CPU time over that of the tool `unit` in the same state."""
    base = {row["state"]: row["cpu_s"] for row in rows if row["tool"] == unit}
    return [row | {"cpu_ratio": row["cpu_s"] / base[row["state"]]} for row in rows]


def text_of(key: str, value: object) -> str:
    """A figure with the digits of its column; text as it is."""
    return f"{value:.{DIGITS.get(key, 3)}f}" if isinstance(value, float) else str(value)


def write_csv(path: str | Path, rows: Sequence[dict], columns: Sequence[str]) -> None:
    """The columns of all rows, rounded."""
    with atomic_path(path) as temporary, temporary.open("w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(columns)
        table.writerows([text_of(key, row[key]) for key in columns] for row in rows)


def fill(readme: str | Path, tables: Sequence[str | Path]) -> None:
    """Put each CSV table where README.md has `<!-- table STEM -->` ... `<!-- end -->`."""
    found = {}
    for path in tables:
        with Path(path).open(newline="") as file:
            found[Path(path).stem] = table(list(csv.reader(file)))
    write_filled(readme, found)
