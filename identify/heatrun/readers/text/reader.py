"""Reader of CSV and other text tables, whatever delimiter, decimal sign and encoding they have.

Lines that hold no sample count where time is counted by lines. `Hints` is what the
motor file says about reading a file.
"""

import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
import pandas as pd

from ...errors import InputError
from ...io.quantities import printable
from ...record.channels import Claim, Columns, parse_claims
from ...record.header import read_heading, split_name
from ...record.record import Finding
from ...record.table import PREAMBLE, Column, Question, Stated, Table, kind_of_frames, no_signals
from ...record.units import find_unit, is_unit
from ..clock import TimeFormat, parse_time_format, stated_format
from ..historian import by_clock, by_tag, columns_without_bad
from .layout import DELIMITERS, Layout, find_layout
from .lines import CODECS, NUM_NAMED, DataLines, data_lines, decode, ragged_lines, restarted
from .remarks import X_NAME, stated_raster, units_of_remarks
from .values import MISSING, findings_of, read_values, signs_joined, unsettled_cells
from .written_otherwise import from_json, units_over_columns

Decimal = Literal[".", ","]


@dataclass(frozen=True)
class Hints:
    """What the motor file says about reading a file."""

    # What the lines of `[columns]` say of each column that they name.
    claims: tuple[Claim, ...] = ()
    decimal: Decimal | None = None  # Decimal sign of the text tables, or None to find it.
    sheet: str | None = None  # Sheet of a workbook that the test names, or None to choose it.

    def unit_of(self, name: str, label: str) -> str | None:
        """Return the unit text that `[columns]` states for a column of this name and label, if any.

        A right-hand side that is the name as it stands in the file states nothing of its own.
        """
        for claim in self.claims:
            if claim.base == name:
                return claim.bracket
            if claim.text != name and claim.unit is not None and claim.label in (name, label):
                return claim.unit
        return None


def hints_of(
    columns: Columns | None, decimal: Decimal | None = None, *, where: str, sheet: str | None = None
) -> Hints:
    """Return what the `[columns]` and `decimal` of a motor file say about reading.

    Raises:
        InputError: If `[columns]` names a channel that is not known.
    """
    claims = parse_claims(columns or {}, where)
    each = (one for claim in claims for one in (claim.parts or (claim,)))
    return Hints(tuple(each), decimal, sheet)


NO_HINTS = Hints()


def with_missing_rows(
    channels: Mapping[str, np.ndarray], sample_numbers: np.ndarray
) -> dict[str, np.ndarray]:
    """Return channels with NaN where lines without a sample stand in the file.

    `sample_numbers` says which sample each value of the channels is, from 0, shape (time,).
    """
    filled = {}
    for name, values in channels.items():
        filled[name] = np.full(int(sample_numbers[-1]) + 1, np.nan)
        filled[name][sample_numbers] = values
    return filled


def missing_rows(
    sample_numbers: np.ndarray, rate_Hz: float | None, time_s: np.ndarray, where: str
) -> Finding:
    """Return the finding about lines without a sample: how many, and where in time.

    Of a file without times of its own the time is made from a rate [Hz].
    """
    steps = np.diff(sample_numbers)
    before = np.flatnonzero(steps > 1)
    count = int(np.sum(steps[before] - 1))
    more = " and more" if before.size > NUM_NAMED else ""
    if rate_Hz is None:
        places = ", ".join(f"{time_s[row]:.6g} s" for row in before[:NUM_NAMED])
        return Finding(
            "rows_missing",
            "note",
            f"{count} lines between the samples are empty or have another number of cells,"
            f" behind {places}{more}. The file's own times are not moved by them.",
            where,
            "Export again if these samples matter.",
            values={"count": count, "from_s": float(time_s[before[0]])},
        )
    first, last = (sample_numbers[before] + 1) / rate_Hz, (sample_numbers[before + 1] - 1) / rate_Hz
    spans = ", ".join(
        f"{low:.6g} s" if low == high else f"{low:.6g} s to {high:.6g} s"
        for low, high in zip(first[:NUM_NAMED], last[:NUM_NAMED], strict=True)
    )
    return Finding(
        "rows_missing",
        "warning",
        f"{count} of {int(sample_numbers[-1]) + 1} samples are missing, at {spans}{more}: "
        "their lines are empty or have another number of cells. The time, made from a rate, goes "
        "on over them.",
        where,
        "Export again if these samples matter, and with a time column.",
        values={"count": count, "from_s": float(first[0])},
    )


HOTTEST = 5000.0
"""Above it no bench works in any unit of temperature: tungsten melts at 3422 degC."""

HEAD_BYTES = 2**16  # in which a log of bus frames shows itself

PARSED_AS_MISSING = sorted({mark for word in MISSING for mark in (word, word.upper(), "NaN")})

# The last bit counts: what a bench wrote is what is read. From 3.1 on that is pandas' only way.
EXACT: dict[str, Any] = (
    {}
    if tuple(int(part) for part in pd.__version__.split(".")[:2]) >= (3, 1)
    else {"float_precision": "round_trip"}
)


def read_text(
    data: bytes, where: str, hints: Hints = NO_HINTS, *, delimiters: Sequence[str] = DELIMITERS
) -> Table:
    """Read a text table, its columns under their names in the file.

    Cells that are no numbers are NaN and lines with another number of cells are left out, both with
    a finding. Clock times and dates are seconds; where the file leaves open which, the column
    carries the question. The delimiters are what may stand between the cells.

    Raises:
        InputError: If the file holds no table with a header and at least one line of numbers.
    """
    text, encoding = decode(data, where)
    if kind := kind_of_frames(text[:HEAD_BYTES]):
        raise no_signals(kind, where)
    if text.lstrip().startswith("<"):
        raise InputError(
            "Expected a table of text, got HTML or XML.",
            where=where,
            remedy="Open it in a spreadsheet and save it as .xlsx or CSV; an HTML table also by "
            "pandas: pd.read_html('FILE')[0].to_csv('table.csv', index=False).",
        )
    text = units_over_columns(signs_joined(from_json(text)))
    layout = find_layout(text, where, hints.decimal, delimiters)
    body = data_lines(text, layout, where)
    del text  # a gigabyte of it would be held while the cells are read
    frame = parsed_cells(body.text, layout, where)
    columns: list[Column] = []
    places: list[int] = []
    texts: dict[str, str] = {}
    notes = [f"{PREAMBLE}{line}" for line in layout.preamble]
    if body.is_double_spaced:
        notes.append("A blank line follows each line; blank lines are no samples.")
    findings = [*ragged_lines(body, layout, where), *restarted(body, where)]
    findings += _settings(layout, where)
    _refuse_units_between(body, layout, where)
    remarks = units_of_remarks(layout.preamble, layout.names)
    unreadable: list[np.ndarray] = []
    asked: dict[int, Question] = {}
    for index in range(layout.width):
        named = layout.names[index] if index < len(layout.names) else ""
        name = named or f"column {index + 1}"
        beside = (
            *(Stated(cell, "the row of units") for row in layout.units if (cell := row[index])),
            *(remarks[index] if index < len(remarks) else ()),
        )
        at = f"{where}, column {index + 1}"
        label, unit, stated = _label_and_unit(name, beside, hints, at)
        cells = frame.iloc[:, index]
        values = read_values(
            cells, layout.decimal, name=name, stated=stated, has_thousands=hints.decimal is not None
        )
        if isinstance(values, str):
            if values or named:
                texts[name] = values
            continue
        if values.unreadable is None and not np.isfinite(values.numbers).any():
            raster = stated_raster(layout.preamble) if name.casefold() == X_NAME else None
            if raster is not None:
                rows = body.sample_numbers
                rows = np.arange(body.numbers.size) if rows is None else rows
                times = raster[0] + raster[1] * rows
                columns.append(Column(name, label, "s", times, f"every {raster[1]:g} s, as stated"))
                places.append(index)
            elif named:
                texts[name] = ""
            continue
        if index >= len(layout.names):
            raise InputError(
                f"The header names {len(layout.names)} columns, the lines of data have "
                f"{index + 1} or more.",
                where=where,
                remedy="Give each column one name, in the order of the data.",
            )
        all_read = np.zeros(values.numbers.size, dtype=bool)
        unreadable.append(all_read if values.unreadable is None else values.unreadable)
        is_open = layout.is_unsettled and values.question is None and not values.is_time
        if is_open and (question := unsettled_cells(cells, layout.decimal)):
            asked[len(columns)] = question
        # a word that is no unit, such as "time" in the row of units, says nothing against a clock
        is_foreign = unit is not None and is_unit(unit) and find_unit(unit, "time") is None
        if values.is_time and (stated is not None or not is_foreign):
            unit = "s"
        column = Column(name, label, unit, values.numbers, values.note, beside,
                        question=values.question, start=values.start)  # fmt: skip
        columns.append(_called(column, layout.called.get(index)))
        places.append(index)
        findings += findings_of(values, name, body.numbers, where)
    _refuse_second_header(unreadable, body.numbers, where)
    columns = _with_milliseconds(columns)
    read = dict(zip(places, columns, strict=True))
    held = [(name, frame.iloc[:, i], read.get(i)) for i, name in enumerate(layout.names)]
    columns, bad = columns_without_bad(held, where, body.numbers)
    findings += bad
    settled = next((columns[index] for index in asked if _is_hot(columns[index])), None)
    if settled is not None:
        notes.append(
            f"'{layout.decimal}' is the decimal sign: '{settled.name}' would be above "
            f"{HOTTEST:g} {settled.unit} otherwise."
        )
    elif (layout.delimiter, layout.decimal) == (",", "."):
        # Who separates thousands by a point has a decimal comma, and then no comma between
        # cells; so it is a doubt and no question.
        findings += [_taken_as_decimal(one, columns[i].name, where) for i, one in asked.items()]
    else:
        for index, question in asked.items():
            columns[index] = replace(columns[index], question=question)
    if not columns or not any(np.isfinite(column.values).any() for column in columns):
        raise InputError(
            "Expected at least one line of numbers, found none.",
            where=where,
            remedy="Check that the export contains the samples.",
        )
    reader = f"text, {layout.description}, {encoding}"
    table = Table(
        tuple(columns), texts, {}, tuple(notes), tuple(findings), reader, body.sample_numbers
    )
    cells = {name: frame.iloc[:, index].rename(name) for index, name in enumerate(layout.names)}
    return by_clock(by_tag(table, cells, where))


def _label_and_unit(
    name: str, beside: Sequence[Stated], hints: Hints, where: str
) -> tuple[str, str | None, TimeFormat | None]:
    """Return label, unit text and stated format of times of a column."""
    label, unit = split_name(name, where)
    own = [one.text for one in beside if one.scope == "column"]
    unit = unit or (own[0] if own else None)
    label, stated = stated_format(name, label, unit)
    if stated is not None and unit is None:
        unit = stated.text
    claimed = parse_time_format(hints.unit_of(name, label) or "")
    return label, unit, claimed or stated


def _called(column: Column, called: str | None) -> Column:
    """Return a column with what a table of channels calls it behind the name of its input."""
    if called is None:
        return column
    label, unit = split_name(called)
    said = () if unit is None else (Stated(unit, "the table of channels"),)
    name = f"{read_heading(column.name).label} {called}"
    return replace(column, name=name, label=label, unit=column.unit or unit,
                   beside=(*column.beside, *said), heading=column.name)  # fmt: skip


def _with_milliseconds(columns: list[Column]) -> list[Column]:
    """Add a column of milliseconds to the clock beside it that counts whole seconds."""
    clocks = [i for i, one in enumerate(columns) if one.note and one.is_seconds]
    parts = [one for one in columns if find_unit(one.name, "time") == find_unit("ms", "time")]
    if len(clocks) != 1 or len(parts) != 1 or not np.nan_to_num(parts[0].values).any():
        return columns
    clock, part = columns[clocks[0]], parts[0]
    whole = clock.values + 1e-3 * part.values
    known = np.isfinite(whole)
    is_part = np.all((part.values[known] >= 0.0) & (part.values[known] < 1e3))
    is_whole = np.all(clock.values[known] % 1.0 == 0.0) and np.all(np.diff(whole[known]) >= 0.0)
    if not (is_part and is_whole):
        return columns
    note = f"{clock.note}, with the milliseconds of '{part.name}'"
    columns[clocks[0]] = replace(clock, values=whole, note=note)
    return columns


def _is_hot(column: Column) -> bool:
    """Return whether a temperature would be none of this world with its sign left out."""
    stated = find_unit(column.unit, "temperature") if column.unit else None
    if stated is None or not np.isfinite(column.values).any():
        return False
    return bool(np.nanmin(np.abs(column.values)) * 1000.0 > HOTTEST)


def _refuse_units_between(body: DataLines, layout: Layout, where: str) -> None:
    """Refuse a line among the data that speaks of units: from there on they may be others."""
    for number, text in zip(body.ragged, body.ragged_texts, strict=False):
        if any(units_of_remarks((text.lstrip("; "),), layout.names)):
            raise InputError(
                f"Line {number} among the data mentions units: '{printable(text[:80])}'.",
                where=where,
                remedy="Split the file there, or delete the line if the units stay the same.",
            )


def _refuse_second_header(unreadable: Sequence[np.ndarray], lines: np.ndarray, where: str) -> None:
    """Refuse a line among the data in which no column holds a number: names or units again."""
    texts = lines[np.logical_and.reduce(unreadable)] if len(unreadable) > 1 else lines[:0]
    if texts.size:
        raise InputError(
            f"Line {texts[0]} holds text in every column of numbers ({texts.size} such "
            "lines): a second table, or a repeated header, whose units may differ.",
            where=where,
            remedy="Split the file there, or delete the line if the units stay the same.",
        )


def _settings(layout: Layout, where: str) -> Iterator[Finding]:
    if count := layout.num_settings:
        yield Finding(
            "rows_above",
            "note",
            f"{count} lines of numbers stand above the names, under other names: they are "
            "no samples of this table.",
            where,
            "If they are a test, save them as a file of their own.",
            values={"count": count},
        )


def _taken_as_decimal(question: Question, name: str, where: str) -> Finding:
    message = f"{question.problem} It is taken as decimal, since commas separate the cells."
    at = f"{where}, column {name}"
    return Finding("decimal_assumed", "warning", message, at, question.remedy)


def parsed_cells(body: bytes, layout: Layout, where: str) -> pd.DataFrame:
    """Return the cells of lines of data; columns that are not all numbers stay texts.

    Raises:
        InputError: If the lines, which have the layout's number of cells, cannot be split.
    """
    try:
        return pd.read_csv(
            io.BytesIO(body),
            sep=r"\s+" if layout.delimiter == " " else layout.delimiter,
            decimal=layout.decimal,
            header=None,
            names=list(range(layout.width)),
            index_col=False,
            keep_default_na=False,
            na_values=PARSED_AS_MISSING,
            skipinitialspace=True,
            low_memory=False,  # one type for a column, not one for each piece of it
            dtype=str if layout.is_unsettled else None,  # the question needs the cells themselves
            **EXACT,
        )
    except (pd.errors.ParserError, pd.errors.EmptyDataError, ValueError, OverflowError) as error:
        raise InputError(
            f"The lines of data could not be split into cells ({error}).",
            where=where,
            remedy="Look for a quotation mark that is not closed.",
        ) from error


def head_of(data: bytes, where: str, hints: Hints) -> bytes | None:
    """Return what stands above the data of a text table; None if its encoding cannot be cut there.

    Raises:
        InputError: If there is no table with a header and a line of numbers.
    """
    text, encoding = decode(data, where)
    if encoding.partition(" ")[0] not in CODECS:
        return None
    first = find_layout(text, where, hints.decimal).first_line
    return b"".join(line + b"\n" for line in data.split(b"\n", first)[:first])
