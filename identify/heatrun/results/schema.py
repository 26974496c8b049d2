"""The JSON schemas of `fit.json` and `discovery.json`, generated from the types.

`python -m heatrun.results.schema fit-1.json` prints one, without a name their names.
"""

import dataclasses
import inspect
import json
import re
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, get_args, get_type_hints

import msgspec

from .discovery import DiscoveryResult
from .model import FitResult

DIALECT = "https://json-schema.org/draft/2020-12/schema"

NOTE = "Fields may be added within a format; none is taken away or changes its meaning."

RUN = {"type": "string", "description": "The run folder; only in what --json prints"}

FIELD = re.compile(r"((?:^ {4}# .*\n)*)^ {4}(\w+): .*?(?:  # (.*))?$", re.M)
"""A field of a type in its source: what is said above it, its name, what is said behind it."""

Schemas = Mapping[str, tuple[type, str]]

SCHEMAS: Schemas = {
    "fit-1.json": (FitResult, "fit.json of heatrun: what `heatrun calibrate` writes"),
    "discovery-2.json": (
        DiscoveryResult,
        "discovery.json of heatrun: what `heatrun discover` writes",
    ),
}
"""Type and title by name of the schema; its number is that of the format."""


def schema_of(name: str, schemas: Schemas = SCHEMAS) -> dict[str, Any]:
    """Return a schema, generated from its type.

    Args:
        name: One of them.
        schemas: Type and title by name of the schema; those of another package have its own types.
    """
    kind, title = schemas[name]
    found = msgspec.json.schema(kind)
    types = _types_within(kind)
    definitions = {key: _tidy(each, types[key]) for key, each in found["$defs"].items()}
    root = definitions.pop(kind.__name__)
    return {
        "$schema": DIALECT,
        "$id": f"heatrun-{Path(name).stem}",
        "title": title,
        "description": f"{root['description']} {NOTE}",
        "type": "object",
        "properties": {**root["properties"], "run": RUN},
        "required": root["required"],
        "additionalProperties": False,
        "$defs": dict(sorted(definitions.items())),
    }


def print_schemas(names: Sequence[str], schemas: Schemas = SCHEMAS) -> int:
    """Print schemas, or the names that there are, and return the exit code."""
    unknown = [name for name in names if name not in schemas]
    if unknown or not names:
        print(*schemas, sep="\n", file=sys.stderr if unknown else sys.stdout)
        return 2 if unknown else 0
    for name in names:
        print(json.dumps(schema_of(name, schemas), indent=1, ensure_ascii=False))
    return 0


def _types_within(kind: Any) -> dict[str, Any]:
    """Return a type and all types that its fields are made of, by name."""
    if not (isinstance(kind, type) and dataclasses.is_dataclass(kind)):
        return {key: one for each in get_args(kind) for key, one in _types_within(each).items()}
    found = {kind.__name__: kind}
    for each in get_type_hints(kind).values():
        found |= _types_within(each)
    return found


def _tidy(definition: dict[str, Any], kind: type) -> dict[str, Any]:
    """Return the schema of a type with what its source says of each field beside the field."""
    said = FIELD.findall("".join(map(inspect.getsource, kind.__mro__[:-1])))  # all but `object`
    words = {name: " ".join([*above.replace("# ", "").split(), behind]).strip()
             for above, name, behind in said}  # fmt: skip
    properties = {
        name: {**each, "description": words[name]} if words[name] else each
        for name, each in definition["properties"].items()
    }
    about = inspect.cleandoc(definition["description"])
    return {**definition, "description": about, "properties": properties}


if __name__ == "__main__":
    sys.exit(print_schemas(sys.argv[1:]))
