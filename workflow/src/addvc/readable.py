"""Whether configurations are YAML at all, told with the line: `python -m addvc.readable FILE ...`."""

import sys
from pathlib import Path

import yaml

INDENT = (
    "the indentation does not fit: keys of a section begin in one column, further in than its name"
)
UNCLOSED = "a quote or a bracket is opened and not closed"
MEANT = {  # beginnings of what the YAML parser says
    "mapping values are not allowed": f"{INDENT}; or a space is missing after a colon here or above",
    "expected <block end>": INDENT,
    "could not find expected ':'": "a colon and a space are needed between key and value",
    "found unexpected end of stream": UNCLOSED,
    "expected ',' or": UNCLOSED,
    "found unknown escape": "a backslash in double quotes: write /, or use single quotes",
    "found character '\\t'": "a tab: indent with spaces",
}


class OnceLoader(yaml.SafeLoader):
    """YAML in which a key may be given once: of two, others take the last without a word."""

    def construct_mapping(self, node, deep=False):
        """As the base class; MarkedYAMLError for a key given twice."""
        seen: dict[str, yaml.Mark] = {}
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode):
                continue
            if key.value in seen:
                words = f"`{key.value}` is given twice: keep one of them"
                raise yaml.MarkedYAMLError(None, seen[key.value], words, key.start_mark)
            seen[key.value] = key.start_mark
        return super().construct_mapping(node, deep)


def fault(path: Path) -> str | None:
    """What is wrong with a file as YAML, with its line and a remedy; None where nothing is."""
    try:
        given = yaml.load(path.read_text(encoding="utf-8"), OnceLoader)
    except UnicodeDecodeError:
        return f"{path}: is not text in UTF-8: save it as plain text"
    except yaml.MarkedYAMLError as error:
        return f"{path}, {fault_words(error)}"
    except (yaml.YAMLError, ValueError, OSError) as error:
        return f"{path}: {' '.join(str(error).split())}"
    if not isinstance(given, dict):
        return f"{path}: has no `key: value` in it; see config/README.md"
    return None


def fault_words(error: yaml.MarkedYAMLError) -> str:
    """The lines of a fault, and what it is."""
    said = str(error.problem)
    meant = next((words for start, words in MEANT.items() if said.startswith(start)), said)
    last = error.problem_mark.line + 1
    first = error.context_mark.line + 1 if error.context_mark and INDENT not in meant else last
    where = f"line {last}" if first == last else f"lines {first} to {last}"
    if meant == said:
        return f"{where}: {said}"
    return f"{where}: this is not YAML: {meant}, as in config/config.yaml ({said})"


if __name__ == "__main__":
    faults = list(filter(None, (fault(Path(name)) for name in sys.argv[1:])))
    print(*(f"addvc: {words}\n" for words in faults), sep="", end="", file=sys.stderr)
    sys.exit(bool(faults))
