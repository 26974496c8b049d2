"""Arrow schemas of a fleet's tables, from a list of columns that says name, kind, unit, meaning."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from heatrun.errors import InputError

LIST = "list of number"
"""The kind of a column that holds numbers side by side."""

Column = tuple[str, str, str, str]
"""Name, kind, unit and meaning."""


def arrow() -> Any:
    """Return pyarrow.

    Raises:
        InputError: If it is not installed.
    """
    try:
        import pyarrow
    except ImportError as error:
        raise InputError(
            "Fleets are written as Parquet, which needs pyarrow, and it is not installed.",
            remedy='Run: pip install "heatrun[fleet]"',
        ) from error
    return pyarrow


def arrow_schema(columns: Sequence[Column], table_format: str) -> Any:
    """Return the Arrow schema of rows; units and meanings stand in the fields' metadata.

    Args:
        columns: In order.
        table_format: Name and version, written into the metadata of the schema.

    Raises:
        InputError: If pyarrow is not installed.
    """
    pa = arrow()
    text, number = pa.string(), pa.float64()
    kinds = {
        "text": text,
        "truth": pa.bool_(),
        "number": number,
        "count": pa.int64(),
        "map": pa.map_(text, text),
        "list of text": pa.list_(text),
        LIST: pa.list_(number),
        "list of file": pa.list_(pa.struct([("path", text), ("role", text), ("sha256", text)])),
    }
    fields = []
    for name, kind, unit, meaning in columns:
        said = {"meaning": meaning} | ({"unit": unit} if unit else {})
        fields.append(pa.field(name, kinds[kind], metadata=said))
    return pa.schema(fields, metadata={"format": table_format})
