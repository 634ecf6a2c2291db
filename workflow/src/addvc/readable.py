"""Whether configurations are YAML at all, told with the line: `python -m addvc.readable FILE ...`."""

import sys
from pathlib import Path

import yaml


def fault(path: Path) -> str | None:
    """What is wrong with a file as YAML, with its line and a remedy; None where nothing is."""
    try:
        given = yaml.safe_load(path.read_text(encoding="utf-8"))
    except UnicodeDecodeError:
        return f"{path}: is not text in UTF-8: save it as plain text"
    except yaml.MarkedYAMLError as error:
        line = error.problem_mark.line + 1
        first = error.context_mark.line + 1 if error.context_mark else line
        where = f"line {line}" if first == line else f"lines {first} to {line}"
        return (
            f"{path}, {where}: this is not YAML ({error.problem}): write `key: value`, with spaces, not "
            "tabs, at the beginning, as in config/config.yaml"
        )
    if not isinstance(given, dict):
        return f"{path}: has no `key: value` in it; see config/README.md"
    return None


if __name__ == "__main__":
    faults = list(filter(None, (fault(Path(name)) for name in sys.argv[1:])))
    print(*(f"addvc: {words}\n" for words in faults), sep="", end="", file=sys.stderr)
    sys.exit(bool(faults))
