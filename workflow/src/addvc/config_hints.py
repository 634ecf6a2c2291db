"""What the user may have meant by a wrong value of the configuration, to end a message with."""

import re
from collections.abc import Iterable

UNITS = {"millimetres": 1e3, "metres": 1e6, "nanometres": 1e-3}  # in micrometres
LIKELY_UM = (1, 200)
"""Voxels of scans of cellular materials, micrometres: what a guess must come to."""


def number_hint(value) -> str:
    """A guess where a text stands for a number: a comma in it, a per cent sign, a unit."""
    if not is_text(value):
        return ""
    if re.fullmatch(r"[-+]?\d+(\.\d*)?[eE][-+]?\d+", value):
        return f" (write {float(value):g}: YAML takes {value} for a text)"
    found = re.fullmatch(r"\s*([-+]?\d+(?:[.,]\d+)?)\s*([^\d.,\s]\S*|)\s*", value)
    if not found:
        return ""
    number, unit = float(found[1].replace(",", ".")), found[2]
    if unit == "%":
        return f" (did you mean {number / 100:g}?)"
    how = "its unit" if unit else "a comma" if "," in found[1] else "quotes"
    return f" (write {number:g}, without {how})"


def no_hint(value, words: str) -> str:
    """How to say none, where a no stands for it."""
    return " (write none: YAML takes no for false)" if value is False and "none" in words else ""


def list_hint(value, schema: dict) -> str:
    """How a text is written where a list of texts is asked for."""
    items = schema.get("items", {})
    texts = "enum" in items or items.get("type") == "string"
    return f" (write [{value}])" if texts and is_text(value) else ""


def limit_hint(key: str, value) -> str:
    """A guess where a value is beyond its limit: a share in per cent, a voxel in another unit, pairs in
    one list."""
    if key == "scans.crop" and isinstance(value, list) and len(value) == 6 and is_flat(value):
        return f" (did you mean {[value[:2], value[2:4], value[4:]]}?)"
    if not isinstance(value, int | float):
        return ""
    if (key == "porosity" or ".strains[" in key) and 1 < value < 100:
        return f" (did you mean {value / 100:g}?)"
    if key == "scans.voxel_size_um":
        for unit, factor in UNITS.items():
            if LIKELY_UM[0] <= value * factor <= LIKELY_UM[1]:
                return f" ({value:g} {unit}? that is {value * factor:g})"
    return ""


def is_flat(values: list) -> bool:
    return all(isinstance(value, int) for value in values)


def is_text(value) -> bool:
    return isinstance(value, str)


def alternatives(words: Iterable[str]) -> str:
    """ "auto, none or a list"."""
    *first, last = words
    return f"{', '.join(first)} or {last}" if first else last
