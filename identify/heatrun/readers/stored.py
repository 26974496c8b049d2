"""Variables of HDF5, netCDF and Parquet with what the file itself states about them.

Units, scaling and marks of missing values stand beside the numbers there, by the conventions of
netCDF (NUG, appendix A, "Attribute conventions") and CF 1.11, sections 3.1, 4.4, 8.1 and 2.5.1.
The reader of Parquet tables is here whole; it needs the extra `heatrun[parquet]`.
"""

import io
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd

from ..errors import InputError
from ..io.open_file import LARGEST_NUMBERS
from ..record.header import split_name
from ..record.table import Column, Question, Stated, Table
from ..record.units import find_unit, is_unit, quantities_of
from .foreign import library, reading
from .historian import LONGEST_MARK, by_tag, columns_without_bad
from .text.values import counted_times

UNIT_KEYS = ("units", "unit", "unit_string", "ni_unitdescription", "unit_description")
MISSING_KEYS = ("_fillvalue", "missing_value")
SCALE_KEYS = ("scale_factor", "add_offset")
RANGE_KEYS = ("valid_range", "valid_min", "valid_max")
TEXT_KEYS = ("long_name", "description", "comment", "label", "title")
"""Attributes in prose, which may name the unit: "losses in kW"."""

KNOWN_KEYS = frozenset(
    (*UNIT_KEYS, *TEXT_KEYS, *MISSING_KEYS, *SCALE_KEYS, *RANGE_KEYS, "_unsigned")
)

OTHER_SCALING = re.compile(
    r"(?:.*_)?(?:scale|scaling|gain|offset|factor|slope|intercept|multiplier|coefficients?|"
    r"calibration)(?:_.*)?"
)
"""Names of attributes by which other writers scale; what they mean differs among them."""

NOT_WRITTEN = 9.969209968386869e36
"""What netCDF stores where nothing was written, in files that name no mark of their own."""

LONGEST_UNIT = 100
LONGEST_TEXT = 300

SINCE = re.compile(r"(?P<unit>[A-Za-zµ]+)\s+since\s+\S.*", re.IGNORECASE | re.DOTALL)
NO_UNIT = ("", "none", "null", "n/a", "unknown", "undefined", "nan")


@dataclass(frozen=True)
class Stored:
    """The numbers of a variable as they are meant."""

    # Float64, in the shape of the file; NaN where the file marks a missing value.
    values: np.ndarray
    unit: str | None = None  # Unit text that stands beside them, or None.
    note: str = ""  # What was done to them, or empty.
    question: Question | None = None  # What the file leaves open, or None.

    @property
    def is_plain(self) -> bool:
        """Return whether the file states nothing beside the numbers."""
        return self.unit is None and not self.note and self.question is None

    def column(
        self,
        name: str,
        values: np.ndarray,
        source: str = "the attribute beside it",
        *,
        heading: str = "",
    ) -> Column:
        """Return values of the variable as a column, with the unit that stands beside it.

        `source` says where the unit stands, `heading` what it is called where the name says more.
        """
        heading = "" if heading == name else heading
        label, by_name = split_name(heading or name)
        times = counted_times(pd.Series(values), values) if self.is_plain else None
        if times is not None:
            return Column(
                name, label, "s", times.numbers, times.note, (), heading, start=times.start
            )
        beside = () if self.unit is None else (Stated(self.unit, source),)
        return Column(
            name, label, self.unit or by_name, values, self.note, beside, heading,
            question=self.question,
        )  # fmt: skip


@dataclass
class _Reading:
    """Values on their way, and what was met."""

    values: np.ndarray  # As far as they are read.
    stored_as: np.dtype  # Type of the numbers in the file.
    notes: list[str] = field(default_factory=list)  # What was done.
    problems: list[str] = field(default_factory=list)  # What was not understood.


def wanted(names: Sequence[str]) -> list[str]:
    """Return those of the names of attributes that say how to read the numbers."""
    keys = [(name, name.casefold()) for name in names]
    return [name for name, key in keys if key in KNOWN_KEYS or OTHER_SCALING.fullmatch(key)]


def as_stated(raw: np.ndarray, attributes: Mapping[str, Any]) -> Stored:
    """Return numbers as the attributes beside them say, text or number by name."""
    said = {name.casefold(): _plain(value) for name, value in attributes.items()}
    is_unsigned = str(said.get("_unsigned", "")).casefold() == "true" and raw.dtype.kind == "i"
    if is_unsigned:
        raw = raw.view(raw.dtype.str.replace("i", "u"))
    found = _Reading(raw.astype(np.float64), raw.dtype)
    _mark_missing(found, said)
    _scale(found, said)
    unit = _unit(found, said)
    if unit is not None and (since := SINCE.fullmatch(unit)):
        # a month and a year have no fixed length; no name of a column says "day" for its unit
        word = since["unit"]
        known = find_unit("days" if word.casefold() == "day" else word, "time")
        if known is None:
            found.problems.append(f"times in '{unit}', which have no fixed length")
            unit = None
        else:
            found.values = found.values * known.factor
            found.notes.append(unit)
            unit = "s"
    problem = f"The file says {'; '.join(found.problems)}: this is not understood."
    remedy = "Export the variable in plain numbers with the attribute 'units', or as CSV."
    question = Question(problem, remedy=remedy) if found.problems else None
    return Stored(found.values, unit, ", ".join(found.notes), question)


def _mark_missing(found: _Reading, said: Mapping[str, Any]) -> None:
    before = np.isnan(found.values)
    missing = np.abs(found.values / NOT_WRITTEN - 1.0) < 1e-6
    for key in MISSING_KEYS:
        if key in said and (marks := _numbers(found, key, said[key])) is not None:
            missing |= np.isin(found.values, _as_stored(marks, found.stored_as))
    limits = _numbers(found, "valid_range", said.get("valid_range", ()))
    if limits is not None and limits.size == 2:
        missing |= (found.values < limits[0]) | (found.values > limits[1])
    for key, is_beyond in (("valid_min", np.less), ("valid_max", np.greater)):
        limit = _numbers(found, key, said[key]) if key in said else None
        if limit is not None and limit.size == 1:
            missing |= is_beyond(found.values, limit)
    count = int(np.sum(missing & ~before))
    if count:
        found.values = np.where(missing, np.nan, found.values)
        found.notes.append(f"{count} values that the file marks as missing")


def _scale(found: _Reading, said: Mapping[str, Any]) -> None:
    factors = {"scale_factor": 1.0, "add_offset": 0.0}
    for key in SCALE_KEYS:
        if key not in said:
            continue
        stated = _numbers(found, key, said[key])
        if stated is not None and (stated.size != 1 or not np.isfinite(stated[0])):
            found.problems.append(f"{key} = {_shown(said[key])}")
        elif stated is not None:
            factors[key] = float(stated[0])
    scale, offset = factors.values()
    if (scale, offset) != (1.0, 0.0):
        found.values = found.values * scale + offset
        found.notes.append(f"stored value times {scale:g} plus {offset:g}")
    for key, value in said.items():
        if key in KNOWN_KEYS or not OTHER_SCALING.fullmatch(key):
            continue
        try:
            stated = np.asarray(value, dtype=np.float64)
        except (TypeError, ValueError):
            continue  # a date of calibration, the name of a scale
        neutral = 0.0 if "offset" in key or "intercept" in key else 1.0
        if np.any(stated != neutral):
            found.problems.append(f"{key} = {stated!s:.40}")


def _unit(found: _Reading, said: Mapping[str, Any]) -> str | None:
    units = []
    for key in UNIT_KEYS:
        text = said.get(key)
        if text is None:
            continue
        if not isinstance(text, str) or len(text) > LONGEST_UNIT:
            found.problems.append(f"{key} = {_shown(text)}")
            continue
        text = text.strip().strip("\0")
        if text.casefold() not in NO_UNIT:
            units.append(text)
    for key in TEXT_KEYS:
        text = said.get(key)
        if isinstance(text, str) and len(text) <= LONGEST_TEXT:
            named = split_name(text.strip("\0"))[1]
            if named is not None and is_unit(named):
                units.append(named)
    others = [unit for unit in dict.fromkeys(units) if not _is_same(unit, units[0])]
    if others:
        found.problems.append(f"two units, {' and '.join((units[0], *others))}")
    return units[0] if units else None


def _is_same(one: str, other: str) -> bool:
    """Return whether two texts are the same unit of some quantity, or one of them since a date."""
    one, other = (since["unit"] if (since := SINCE.fullmatch(u)) else u for u in (one, other))
    shared = [q for q in quantities_of(one) if find_unit(other, q) is not None]
    return any(find_unit(one, q) == find_unit(other, q) for q in shared) or one == other


def _as_stored(marks: np.ndarray, stored_as: np.dtype) -> np.ndarray:
    """Return marks of missing values as the type of the numbers holds them."""
    if stored_as.kind == "f":
        with np.errstate(over="ignore"):
            return marks.astype(stored_as).astype(np.float64)
    if stored_as.kind == "u":  # a mark of numbers that are declared unsigned may be signed itself
        return np.where(marks < 0, marks + 2.0 ** (8 * stored_as.itemsize), marks)
    return marks


def _numbers(found: _Reading, key: str, value: Any) -> np.ndarray | None:
    try:
        return np.atleast_1d(np.asarray(value, dtype=np.float64)).ravel()
    except (TypeError, ValueError):
        found.problems.append(f"{key} = {_shown(value)}")
        return None


def _plain(value: Any) -> Any:
    """Return text for bytes and the only element of an array."""
    if isinstance(value, np.ndarray) and value.size == 1:
        value = value.ravel()[0]
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace")
    if isinstance(value, np.generic):
        return value.item()
    return value


def _shown(value: Any) -> str:
    return f"{value!r:.40}" if isinstance(value, str) else f"{value!s:.40}"


NANOSECONDS = 1e-9


def read_parquet(data: bytes, where: str) -> Table:
    """Read a Parquet table.

    Numbers and truth values are columns, timestamps seconds from the first one, durations seconds;
    an index that pandas stored is a column like the others. Units and scaling that the metadata of
    a field state are followed, as those of the other variables here.

    Raises:
        InputError: If pyarrow is not installed, the file is damaged or holds no numbers.
    """
    library("pyarrow.parquet", "Parquet", where)
    with reading("a Parquet table", where):
        table, texts = _read_fields(data)
        held, cells = [], {}
        by_column = _units_of_frame(table.schema)
        for field, chunks in zip(table.schema, table.columns, strict=True):
            # pandas' unnamed index of times
            is_unnamed = _is_time(field.type) and field.name.startswith("__index_level_")
            name = "time" if is_unnamed else field.name
            values, note = _values(chunks, field.type)
            if values is None:
                texts[name] = f"{field.type}"
                cells[name] = chunks.to_pandas().rename(name)
                held.append((name, cells[name], None))
                continue
            if note:
                start = note.rpartition("seconds from ")[2]
                column = Column(name, split_name(name)[0], "s", values, note, start=start)
            else:
                stored = as_stated(values, _attributes(field, by_column.get(field.name)))
                column = stored.column(name, stored.values, "the field's metadata")
            held.append((name, values, column))
        columns, findings = columns_without_bad(held, where)
        columns += _range_index(table.schema, table.num_rows)
    if not columns or table.num_rows == 0:
        raise InputError(
            "Expected at least one row of numbers, found none.",
            where=where,
            remedy="Check that the export contains the samples.",
        )
    table = Table(tuple(columns), texts, {}, (), tuple(findings), "Parquet")
    return by_tag(table, cells, where)


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


def _read_fields(data: bytes) -> tuple[Any, dict[str, str]]:
    """Return the columns of numbers and of short texts as a table, the types of the others by name.

    Each text is unpacked once: a few kilobytes of them can stand for any length.
    """
    import pyarrow.parquet

    file = pyarrow.parquet.ParquetFile(io.BytesIO(data))
    kinds, about = file.schema_arrow, file.metadata
    short = [field.name for field in kinds if _is_short_text(field, about)]
    wanted = [field.name for field in kinds if _is_number(field.type) or field.name in short]
    texts = {field.name: f"{field.type}" for field in kinds if field.name not in wanted}
    groups = [about.row_group(index).num_rows for index in range(about.num_row_groups)]
    if min(groups, default=0) < 0 or sum(groups) != about.num_rows:  # pyarrow makes room for them
        raise ValueError(f"{sum(groups)} rows in its groups, {about.num_rows} in all")
    size = about.num_rows * len(wanted)
    if size > LARGEST_NUMBERS:
        raise ValueError(f"{size} numbers, more than the {LARGEST_NUMBERS} that are read")
    file = pyarrow.parquet.ParquetFile(io.BytesIO(data), read_dictionary=short)
    return file.read(columns=wanted), texts


def _is_short_text(field, about) -> bool:
    """Return whether a field holds texts, in which marks and tags may stand."""
    from pyarrow import types

    kind = field.type.value_type if types.is_dictionary(field.type) else field.type
    if not (types.is_string(kind) or types.is_large_string(kind)):
        return False
    groups = [about.row_group(index) for index in range(about.num_row_groups)]
    chunks = [group.column(i) for group in groups for i in range(group.num_columns)]
    own = [one.total_uncompressed_size for one in chunks if one.path_in_schema == field.name]
    return bool(own) and sum(own) <= LONGEST_MARK * about.num_rows


def _is_number(kind) -> bool:
    from pyarrow import types

    readable = ("timestamp", "duration", "boolean", "integer", "floating", "decimal")
    return any(getattr(types, f"is_{one}")(kind) for one in readable)


def _is_time(kind) -> bool:
    from pyarrow import types

    return types.is_timestamp(kind) or types.is_duration(kind)


def _values(chunks, kind) -> tuple[np.ndarray | None, str]:
    """Return a column as float64 with a note on how times were read; None if it is no number."""
    import pyarrow
    from pyarrow import types

    if _is_time(kind):
        is_duration = types.is_duration(kind)
        to = pyarrow.duration("ns") if is_duration else pyarrow.timestamp("ns", kind.tz)
        whole = chunks.cast(to)
        valid = whole.is_valid().to_numpy()
        ticks = whole.cast(pyarrow.int64()).fill_null(0).to_numpy()
        if is_duration or not valid.any():
            return np.where(valid, ticks * NANOSECONDS, np.nan), "a duration"
        first = int(ticks[valid][0])
        # Subtracted as integers: as float64, a date of today is only good to 0.2 µs.
        seconds = np.where(valid, (ticks - first) * NANOSECONDS, np.nan)
        return seconds, f"seconds from {np.datetime64(first, 'ns')}"
    if not _is_number(kind):
        return None, ""
    whole = chunks.cast(pyarrow.int8()) if types.is_boolean(kind) else chunks
    return whole.cast(pyarrow.float64(), safe=False).to_numpy().astype(np.float64), ""


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
