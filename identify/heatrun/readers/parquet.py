"""Reader of Parquet tables; needs the extra `heatrun[parquet]`."""

from __future__ import annotations

import io
import json
from typing import Any

import numpy as np

from ..errors import InputError
from ..io.open_file import LARGEST_NUMBERS
from ..record.header import split_name
from ..record.table import Column, Table
from .foreign import library, reading
from .stored import as_stated, wanted

NANOSECONDS = 1e-9


def read_parquet(data: bytes, where: str) -> Table:
    """Read a Parquet table.

    Returns:
        Numbers and truth values as columns, timestamps in seconds from the first one, durations
        in seconds; an index that pandas stored is a column like the others. Units and
        scaling that the metadata of a field state are followed, as `heatrun.readers.stored`
        does.

    Raises:
        InputError: If pyarrow is not installed, the file is damaged or holds no numbers.
    """
    pyarrow = library("pyarrow.parquet", "Parquet", where)
    with reading("a Parquet table", where):
        table, texts = _numbers_of(pyarrow.ParquetFile(io.BytesIO(data)))
        columns = []
        by_column = _units_of_frame(table.schema)
        for field, chunks in zip(table.schema, table.columns, strict=True):
            name = "time" if _is_unnamed_time(field) else field.name
            values, note = _values(chunks, field.type)
            if values is None:
                texts[name] = f"{field.type}"
                continue
            if note:
                start = note.rpartition("seconds from ")[2]
                columns.append(Column(name, split_name(name)[0], "s", values, note, start=start))
                continue
            stored = as_stated(values, _attributes(field, by_column.get(field.name)))
            columns.append(stored.column(name, stored.values, "the field's metadata"))
        columns += _range_index(table.schema, table.num_rows)
    if not columns or table.num_rows == 0:
        raise InputError(
            "Expected at least one row of numbers, found none.",
            where=where,
            remedy="Check that the export contains the samples.",
        )
    return Table(tuple(columns), texts, {}, (), (), "Parquet")


def _attributes(field: Any, unit: str | None) -> dict[str, str]:
    """Return what the metadata of a field, or of the whole frame, say about its numbers."""
    metadata = {
        key.decode("utf-8", "replace"): text.decode("utf-8", "replace")
        for key, text in (field.metadata or {}).items()
    }
    of_frame = {} if unit is None else {"unit_string": unit}
    return of_frame | {name: metadata[name] for name in wanted(list(metadata))}


def _units_of_frame(schema: Any) -> dict[str, str]:
    """Return units by column that pandas keeps as attributes of a frame."""
    attributes = json.loads((schema.metadata or {}).get(b"PANDAS_ATTRS", b"{}"))
    units: dict[str, str] = {}
    for key in ("unit", "units"):
        held = attributes.get(key) if isinstance(attributes, dict) else None
        if isinstance(held, dict):
            units |= {name: text for name, text in held.items() if isinstance(text, str)}
    return units


def _numbers_of(file) -> tuple[Any, dict[str, str]]:
    """Return the columns that may hold numbers as a table, and the types of the others by name.

    Texts are not unpacked: a few kilobytes of them can stand for any length.
    """
    kinds = file.schema_arrow
    wanted = [field.name for field in kinds if _is_number(field.type)]
    texts = {field.name: f"{field.type}" for field in kinds if not _is_number(field.type)}
    about = file.metadata
    groups = [about.row_group(index).num_rows for index in range(about.num_row_groups)]
    if min(groups, default=0) < 0 or sum(groups) != about.num_rows:  # pyarrow makes room for them
        raise ValueError(f"{sum(groups)} rows in its groups, {about.num_rows} in all")
    size = about.num_rows * len(wanted)
    if size > LARGEST_NUMBERS:
        raise ValueError(f"{size} numbers, more than the {LARGEST_NUMBERS} that are read")
    return file.read(columns=wanted), texts


def _is_number(kind) -> bool:
    from pyarrow import types

    readable = (
        types.is_timestamp,
        types.is_duration,
        types.is_boolean,
        types.is_integer,
        types.is_floating,
        types.is_decimal,
    )
    return any(test(kind) for test in readable)


def _is_unnamed_time(field) -> bool:
    """Return whether a field is pandas' unnamed index and holds times."""
    import pyarrow.types

    is_time = pyarrow.types.is_timestamp(field.type) or pyarrow.types.is_duration(field.type)
    return is_time and field.name.startswith("__index_level_")


def _values(chunks, kind) -> tuple[np.ndarray | None, str]:
    """Return a column as float64 with a note on how times were read; None if it is no number."""
    import pyarrow
    import pyarrow.types

    if pyarrow.types.is_timestamp(kind) or pyarrow.types.is_duration(kind):
        whole = chunks.cast(
            pyarrow.timestamp("ns", kind.tz)
            if pyarrow.types.is_timestamp(kind)
            else pyarrow.duration("ns")
        )
        valid = whole.is_valid().to_numpy()
        ticks = whole.cast(pyarrow.int64()).fill_null(0).to_numpy()
        if pyarrow.types.is_duration(kind) or not valid.any():
            return np.where(valid, ticks * NANOSECONDS, np.nan), "a duration"
        first = int(ticks[valid][0])
        # Subtracted as integers: as float64, a date of today is only good to 0.2 µs.
        seconds = np.where(valid, (ticks - first) * NANOSECONDS, np.nan)
        return seconds, f"seconds from {np.datetime64(first, 'ns')}"
    if pyarrow.types.is_boolean(kind):
        return chunks.cast(pyarrow.int8()).cast(pyarrow.float64()).to_numpy(), ""
    if pyarrow.types.is_integer(kind) or pyarrow.types.is_floating(kind):
        return chunks.cast(pyarrow.float64(), safe=False).to_numpy().astype(np.float64), ""
    if pyarrow.types.is_decimal(kind):
        return chunks.cast(pyarrow.float64()).to_numpy(), ""
    return None, ""


def _range_index(schema, num_rows: int) -> list[Column]:
    """Return the named regular index that pandas keeps in the metadata alone."""
    metadata = json.loads((schema.metadata or {}).get(b"pandas", b"{}"))
    columns = []
    for index in metadata.get("index_columns", ()):
        if isinstance(index, dict) and index.get("kind") == "range" and index.get("name"):
            label, unit = split_name(index["name"])
            values = index["start"] + index["step"] * np.arange(num_rows, dtype=np.float64)
            columns.append(Column(index["name"], label, unit, values))
    return columns
