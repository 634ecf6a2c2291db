"""The one family of errors a user can mend: the message gives the value, the limit, the remedy."""

from collections.abc import Iterable
from pathlib import Path

MARK = "ERROR: "
"""What an error begins with in the log of a job, where it is the last thing said."""


def error_in(log: str | Path) -> str:
    """The error that a job has left in its log; "" where there is none."""
    text = Path(log).read_text() if Path(log).is_file() else ""
    return text.partition(MARK)[2].strip()


class AddvcError(ValueError):
    """Something in the input or the configuration that the user can change."""


class ScanError(AddvcError):
    """A scan that cannot be read, or is not what the configuration says it is."""


class ConfigError(AddvcError):
    """A configuration that cannot be run."""


class GeometryError(AddvcError):
    """A specimen, threshold or surface that cannot be made from the image."""


class MeshError(AddvcError):
    """A mesh on which no displacement could be trusted."""


class CorrelationError(AddvcError):
    """A linear system or a registration that cannot be solved."""


def refuse(faults: Iterable[str], kind: type[AddvcError], what: str = "") -> None:
    """An error of this kind with all faults, each once, where there are any; `what`: of what."""
    different = list(dict.fromkeys(faults))
    if len(different) == 1:
        raise kind(different[0])
    if different:
        lines = "".join(f"\n- {fault}" for fault in different)
        raise kind(f"{len(different)} things are wrong{what}:{lines}")


def grey_words(value: float | None, places: int = 2) -> str:
    """A grey level in words: to a tenth, with some decimal places below 10, with three digits where it
    is as small as an attenuation; "unknown" for None."""
    if value is None:
        return "unknown"
    size = abs(value)
    return (
        f"{value:.1f}" if size >= 10 else f"{value:.{places}f}" if size >= 0.1 else f"{value:.3g}"
    )
