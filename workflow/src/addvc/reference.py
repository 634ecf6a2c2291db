"""config/README.md from the schema: `python -m addvc.reference > config/README.md`."""

from pathlib import Path

import yaml

SCHEMA = Path(__file__).parents[2] / "schemas" / "config.schema.yaml"

HEAD = """# Configuration

One YAML file says everything about a case: `./addvc run --configfile FILE`. It replaces
`config.yaml`, the default case (the synthetic twin); it does not extend it. Give either `scans`
(yours) or `twin` (the synthetic test). Keys that are left out take their default; a misspelt key is
an error. Lengths are in voxels of the binned image unless the line says otherwise. Paths of scans
start at the folder of the repository.

Made from `workflow/schemas/config.schema.yaml` by `python -m addvc.reference > config/README.md`.
"""


def rows(schema: dict, path: str = "") -> list[str]:
    """Lines of the table of one level of the schema, sections followed by their keys."""
    lines = []
    required = schema.get("required", [])
    for key, spec in schema["properties"].items():
        name = f"{path}{key}"
        if "properties" in spec:
            lines += ["", f"## `{name}`", ""]
            lines += [spec["description"], ""] if "description" in spec else []
            lines += ["| key | value | default | meaning |", "|---|---|---|---|"]
            lines += rows(spec, f"{name}.")
        else:
            preset = "required" if key in required else default(spec)
            lines.append(f"| `{name}` | {kind(spec)} | {preset} | {spec['description']} |")
    return lines


def kind(spec: dict) -> str:
    """What a key may be, in words."""
    if "const" in spec:
        return f"`{spec['const']}`"
    if "enum" in spec:
        return ", ".join(f"`{value}`" for value in spec["enum"])
    if "anyOf" in spec:
        return " or ".join(kind(option) for option in spec["anyOf"])
    name = spec.get("type", "any")
    name = " or ".join(name) if isinstance(name, list) else name
    words = {
        "minimum": "from",
        "exclusiveMinimum": "above",
        "maximum": "to",
        "exclusiveMaximum": "below",
    }
    bounds = [f"{word} {spec[limit]}" for limit, word in words.items() if limit in spec]
    if name == "array" and "enum" in spec.get("items", {}):
        return "list of " + kind(spec["items"])
    return " ".join([name, *bounds])


def default(spec: dict) -> str:
    """The default of a key, as YAML has it."""
    if "default" not in spec:
        return "optional"
    return (
        f"`{yaml.safe_dump(spec['default'], default_flow_style=True).replace('...', '').strip()}`"
    )


def page(schema: dict) -> str:
    """The whole page: keys of the top level first, then the sections."""
    plain = {key: spec for key, spec in schema["properties"].items() if "properties" not in spec}
    parts = {key: spec for key, spec in schema["properties"].items() if "properties" in spec}
    top = ["| key | value | default | meaning |", "|---|---|---|---|"]
    return (
        "\n".join([HEAD, *top, *rows({"properties": plain}), *rows({"properties": parts})]) + "\n"
    )


if __name__ == "__main__":
    print(page(yaml.safe_load(SCHEMA.read_text())), end="")
