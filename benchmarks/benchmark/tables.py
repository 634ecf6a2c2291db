"""Tables as CSV, and the same in markdown between marks of README.md."""

import csv
import re
from collections.abc import Sequence
from pathlib import Path

from addvc.errors import AddvcError
from addvc.images.files import atomic_path

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


def markdown(path: str | Path) -> str:
    """A CSV table as markdown."""
    with Path(path).open(newline="") as file:
        head, *rows = csv.reader(file)
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def fill(readme: str | Path, tables: Sequence[str | Path]) -> None:
    """Put each table where README.md has `<!-- table STEM -->` ... `<!-- end -->`."""
    text = Path(readme).read_text()
    for path in tables:
        stem = Path(path).stem
        pattern = re.compile(rf"(<!-- table {re.escape(stem)} -->\n).*?(<!-- end -->)", re.S)
        if not pattern.search(text):
            raise AddvcError(
                f"{readme} has no mark `<!-- table {stem} -->`; add it and `<!-- end -->`"
            )
        table = markdown(path)
        text = pattern.sub(lambda found, table=table: f"{found[1]}\n{table}\n\n{found[2]}", text)
    with atomic_path(readme) as temporary:
        temporary.write_text(text)
