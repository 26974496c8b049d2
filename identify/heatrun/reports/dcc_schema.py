"""Is a Digital Calibration Certificate valid? By the schema of PTB, from the user's own copy.

The schema is not shipped: it is LGPL-3.0 and comes in three files (dcc.xsd, SI_Format.xsd,
xmldsig-core-schema.xsd, and quantityKind.xsd where SI_Format.xsd asks for it). They lie in one
folder or below it; nothing is fetched from the network.
"""

import io
from importlib import import_module
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from ..errors import InputError

MOST_TOLD = 3
"""Violations that a message names."""


def validate(document: bytes, schema: Path) -> None:
    """Check a certificate against the schema.

    Raises:
        InputError: If xmlschema is not installed, the schema cannot be read, or the certificate
            violates it.
    """
    try:
        xmlschema = import_module("xmlschema")
    except ImportError as error:
        raise InputError(
            "Validating a Digital Calibration Certificate needs xmlschema, which is not installed.",
            where=str(schema),
            remedy='Run: pip install "heatrun[dcc]"',
        ) from error
    checker = _loaded(xmlschema, schema)
    violations = [
        f"{each.path}: {str(each.reason or each.message).splitlines()[0][:200]}"
        for each in checker.iter_errors(io.BytesIO(document))
    ]
    if violations:
        more = f" and {len(violations) - MOST_TOLD} more" if len(violations) > MOST_TOLD else ""
        raise InputError(
            "The Digital Calibration Certificate does not follow the schema: "
            f"{'; '.join(violations[:MOST_TOLD])}{more}.",
            where=str(schema),
            remedy="Check that it is the schema of version 3.3.0.",
        )


def _loaded(xmlschema: Any, schema: Path) -> Any:
    """Return the schema with those that it imports, out of its own folder alone."""
    import warnings

    locations = [(space, str(path)) for space, path in _beside(schema)]
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # an import that is not there is a warning only
            return xmlschema.XMLSchema(str(schema), locations=locations, allow="local")
    except Exception as error:  # a file of another kind fails in nearly any way
        raise InputError(
            f"The schema cannot be read ({type(error).__name__}: "
            f"{(str(error).splitlines() or ['no reason given'])[0][:200]}).",
            where=str(schema),
            remedy="Put dcc.xsd, SI_Format.xsd and xmldsig-core-schema.xsd into one folder and "
            "give dcc.xsd.",
        ) from error


def _beside(schema: Path) -> list[tuple[str, Path]]:
    """Return the namespaces of the other schemas in the folder, with their files."""
    found = []
    for path in sorted(schema.parent.rglob("*.xsd")):
        if path == schema:
            continue
        try:
            for _, element in ElementTree.iterparse(path, events=("start",)):
                found.append((element.get("targetNamespace", ""), path))
                break
        except (ElementTree.ParseError, OSError):
            continue
    return found
