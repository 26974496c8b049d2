"""The JSON schemas of `fit.json` and `discovery.json`, generated from the types.

They are shipped beside the types. `python -m heatrun.results.schema` (`make schemas`) writes them
again after a type was changed; a test compares the two.
"""

from __future__ import annotations

import inspect
import json
import re
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any

import msgspec

from .discovery import DiscoveryResult
from .model import FitResult

DIALECT = "https://json-schema.org/draft/2020-12/schema"

NOTE = "Fields may be added within a format; none is taken away or changes its meaning."

RUN = {"type": "string", "description": "The run folder; only in what --json prints"}

ATTRIBUTE = re.compile(r"^ {4}(\w+): (.*(?:\n {8}.*)*)", re.M)
"""A field and its description in a docstring."""

Schemas = Mapping[str, tuple[type, str]]

SCHEMAS: Schemas = {
    "fit-1.json": (FitResult, "fit.json of heatrun: what `heatrun calibrate` writes"),
    "discovery-2.json": (
        DiscoveryResult,
        "discovery.json of heatrun: what `heatrun discover` writes",
    ),
}
"""Type and title by name of the file; its number is that of the format."""


def schema_of(name: str, schemas: Schemas = SCHEMAS) -> dict[str, Any]:
    """Return a schema, generated from its type.

    Args:
        name: One of them.
        schemas: Type and title by name of the file; those of another package have its own types.
    """
    kind, title = schemas[name]
    found = msgspec.json.schema(kind)
    definitions = {key: _tidy(each) for key, each in found["$defs"].items()}
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


def schema_text(name: str, schemas: Schemas = SCHEMAS) -> str:
    """Return a schema as it stands in its file; arguments as `schema_of`."""
    return json.dumps(schema_of(name, schemas), indent=1, ensure_ascii=False) + "\n"


def shipped(name: str, package: str = "heatrun.results") -> dict[str, Any]:
    """Return a schema as it is shipped beside the types of a package."""
    file = files(package) / "schemas" / name
    return json.loads(file.read_text(encoding="utf-8"))


def write_schemas(folder: Path, schemas: Schemas = SCHEMAS) -> list[Path]:
    """Write all schemas into a folder and return their paths."""
    paths = [folder / name for name in schemas]
    for path in paths:
        path.write_text(schema_text(path.name, schemas), encoding="utf-8")
    return paths


def _tidy(definition: dict[str, Any]) -> dict[str, Any]:
    """Return the schema of a type with what its docstring says of each field beside the field."""
    if "description" not in definition:
        return definition
    said, _, attributes = inspect.cleandoc(definition["description"]).partition("Attributes:\n")
    words = dict(ATTRIBUTE.findall(attributes))
    return {
        **definition,
        "description": said.strip(),
        "properties": {
            name: {**each, "description": " ".join(words[name].split())} if name in words else each
            for name, each in definition["properties"].items()
        },
    }


if __name__ == "__main__":
    for path in write_schemas(Path(__file__).with_name("schemas")):
        print(path)
