"""What is wrong with a configuration: all of it at once, each fault with its key, value and remedy."""

import difflib
import os
from collections.abc import Iterator

from jsonschema import Draft202012Validator, ValidationError

from addvc import config as settings
from addvc.config_hints import (
    alternatives,
    is_text,
    limit_hint,
    list_hint,
    no_hint,
    number_hint,
)
from addvc.config_pairs import pair_faults
from addvc.errors import ConfigError, refuse

KINDS = {
    "number": "a number",
    "integer": "a whole number",
    "string": "a text",
    "boolean": "true or false",
    "array": "a list",
    "object": "a section of keys",
}
KIND_RULES = ("const", "enum", "type")
"""Rules of the schema on what kind of value there may be, where several kinds may."""

LIMITS = {
    "minimum": "at least {}",
    "maximum": "at most {}",
    "exclusiveMinimum": "above {}",
    "exclusiveMaximum": "below {}",
    "minItems": "a list of at least {}",
    "maxItems": "a list of at most {}",
}


def check_config(config: dict, schema: dict) -> list[str]:
    """Warnings about a configuration as the user gave it, without defaults.

    Raises ConfigError with every unknown key, every value the schema does not allow, every pair of
    values that do not go together and, beside any of these, the scans that are not there."""
    faults = [*key_faults(config, schema), *value_faults(config, schema)]
    faults += pair_faults(config, told=bool(faults))
    if faults:
        refuse([*faults, *missing_scans(config)], ConfigError)
    return given_warnings(config)


def key_faults(config: dict, schema: dict, path: str = "") -> Iterator[str]:
    """Each key that the schema does not know, with the nearest one that it does."""
    known = schema.get("properties", {})
    for key, value in config.items():
        if key not in known:
            near = inner_key(str(key), known) or nearest(str(key), known)
            hint = f"did you mean `{path}{near}`?" if near else "see config/README.md."
            yield f"unknown key `{path}{key}`: {hint} Known here: {', '.join(known)}"
        elif isinstance(value, dict):
            options = [known[key], *known[key].get("anyOf", [])]
            inner = next((option for option in options if "properties" in option), None)
            if inner:
                yield from key_faults(value, inner, f"{path}{key}.")


def inner_key(word: str, known: dict) -> str | None:
    """Where a word is a key of a section: `scans.axes`; None if it is none."""
    sections = (name for name in known if word in known[name].get("properties", {}))
    return next((f"{name}.{word}" for name in sections), None)


def nearest(word: str, known) -> str | None:
    """The known word most like another one, whatever its case and underscores; None if none is."""
    plain = {str(name).lower().replace("_", ""): name for name in known}
    near = difflib.get_close_matches(word.lower().replace("_", ""), plain, 1)
    return plain[near[0]] if near else None


def value_faults(config: dict, schema: dict) -> Iterator[str]:
    """Each value that the schema does not allow, and each key that it asks for, in a line."""
    errors = Draft202012Validator(schema).iter_errors(config)
    told: list[tuple] = []
    for error in sorted(errors, key=lambda error: list(map(str, error.absolute_path))):
        path = tuple(error.absolute_path)
        if any(path[: len(above)] == above for above in told) or is_told(error):
            continue
        if error.validator not in ("required", "contains"):
            told.append(path)
        yield f"{fault_words(error)}. {meaning(error, schema)}"


def is_told(error: ValidationError) -> bool:
    """Whether `key_faults` tells of an error: an unknown key, or one that is missing since the nearest
    to it is given."""
    if error.validator == "additionalProperties":
        return True
    if error.validator == "anyOf" and not inner_faults(error):
        return any(one.validator == "additionalProperties" for one in error.context)
    if error.validator != "required":
        return False
    known = error.schema["properties"]
    unknown = [str(key) for key in error.instance if key not in known]
    return place(error)[-1] in [nearest(key, known) for key in unknown]


def fault_words(error: ValidationError) -> str:
    """A key, its value and the limit that it breaks."""
    key, value, limit = key_of(error), error.instance, error.validator_value
    given = "empty" if value is None else repr(value)
    match error.validator:
        case "anyOf":
            inner = inner_faults(error)
            if inner:
                return fault_words(inner[0])
            words = alternatives(word for option in limit for word in option_words(option))
            number = any(option.get("type") == "number" for option in limit)
            hint = no_hint(value, words) or (number_hint(value) if number else "")
            return f"`{key}` is {given}; it must be {words}{hint}"
        case "required":
            return f"`{'.'.join(map(str, place(error)))}` is missing"
        case "type":
            kinds = [limit] if isinstance(limit, str) else limit
            words = alternatives(KINDS.get(kind, "null") for kind in kinds)
            hint = list_hint(value, error.schema) if "array" in kinds else ""
            hint = number_hint(value) if {"number", "integer"} & set(kinds) else hint
            return f"`{key}` is {given}; it must be {words}{hint}"
        case "enum":
            near = nearest(str(value), limit)
            hint = f" (did you mean {near}?)" if near else ""
            return f"`{key}` is {given}; it must be one of {listed(limit)}{hint}"
        case "contains":
            return f"`{key}` is {given}; at least one of {listed(limit['enum'])} must be in it"
        case "uniqueItems":
            return f"`{key}` is {given}; nothing may be in it twice"
        case "pattern":
            return f"`{key}` is {given}; only letters, digits, - and _ may be in it"
        case name if name in LIMITS:
            words = LIMITS[name].format(limit)
            return f"`{key}` is {given}; it must be {words}{limit_hint(key, value)}"
    return f"`{key}`: {error.message}"


def place(error: ValidationError) -> list:
    """The keys and numbers that lead to what an error is about: to the value, or to a missing key."""
    path = list(error.absolute_path)
    return [*path, error.message.split("'")[1]] if error.validator == "required" else path


def key_of(error: ValidationError) -> str:
    """The place of an error in the configuration: `scans.states[0]`."""
    parts = [f"[{key}]" if isinstance(key, int) else f".{key}" for key in error.absolute_path]
    return "".join(parts).removeprefix(".") or "the configuration"


def listed(values) -> str:
    """Values as a configuration has them."""
    return ", ".join(map(str, values))


def inner_faults(error: ValidationError) -> list[ValidationError]:
    """What is wrong within the one of several kinds of value that there is, but for unknown keys."""
    return [
        one
        for one in error.context
        if one.validator != "additionalProperties" and (one.path or one.validator not in KIND_RULES)
    ]


def option_words(option: dict) -> list[str]:
    """What one of several kinds of value may be: ["auto", "none"], ["a number"]."""
    if "type" in option:
        return [KINDS[option["type"]]]
    return list(map(str, option.get("enum", [option.get("const")])))


def meaning(error: ValidationError, schema: dict) -> str:
    """What the schema says of the key that an error is about: of the one that has a description, going
    up from the value itself."""
    words = "See config/README.md"
    for key in place(error):
        schema = (
            schema.get("items", {}) if isinstance(key, int) else schema.get("properties", {})[key]
        )
        words = schema.get("description", words)
    return words


def missing_scans(config: dict) -> list[str]:
    """The scans of a configuration, however wrong in other things, that are not there."""
    scans = config.get("scans")
    if not isinstance(scans, dict):
        return []
    states = scans.get("states", [])
    paths = [scans.get("reference"), *(states if isinstance(states, list) else [])]
    faults = []
    for path in filter(is_text, paths):
        try:
            settings.scan_files(os.path.expanduser(path))
        except ConfigError as error:
            faults.append(str(error))
    return faults


def given_warnings(config: dict) -> list[str]:
    """Warnings about real scans, and about a configuration that seems to lack them."""
    if "scans" not in config:
        lacks = config.get("case", settings.DEMO) != settings.DEMO and "twin" not in config
        words = (
            "there is neither `scans` nor `twin`: the default synthetic twin will be made as case"
        )
        return [f"{words} {config['case']}"] if lacks else []
    found = []
    if settings.case_kind(config) == "scans" and not config["scans"].get("states"):
        found.append(
            "scans.states is empty: only the reference will be worked on; list the loaded scans, "
            "or give `virtual` to have the reference deformed by a known field"
        )
    if "loading_axis" not in config:
        found.append(
            "loading_axis is not given: compression along y, the rows of a TIFF page, is supposed"
        )
    return found
