"""Reader of CSV and other text tables, whatever delimiter, decimal sign and encoding they have."""

from __future__ import annotations

import io
from dataclasses import dataclass

import numpy as np
import pandas as pd

from ..errors import InputError
from .header import split_name
from .record import Finding
from .table import Column, Table
from .text_encoding import decode
from .text_layout import MISSING, Layout, find_layout
from .text_values import read_values, unreadable_cells

RAGGED_LIMIT = 0.1
"""Share of lines with another number of cells beyond which the layout was not understood."""

PARSED_AS_MISSING = sorted({mark for word in MISSING for mark in (word, word.upper(), "NaN")})


@dataclass(frozen=True)
class _Body:
    """The lines of data that have the right number of cells, and where they stand."""

    text: str
    lines: np.ndarray  # line number in the file of each row, from 1
    ragged: np.ndarray  # line numbers left out


def read_text(data: bytes, where: str) -> Table:
    """Read a text table.

    Args:
        data: The bytes of the file.
        where: The file, for messages.

    Returns:
        The columns under their names in the file. Cells that are no numbers are NaN and lines
        with another number of cells are left out, both with a finding. Clock times and dates are
        seconds.

    Raises:
        InputError: If the file holds no table with a header and at least one line of numbers.
    """
    text, encoding = decode(data, where)
    layout = find_layout(text, where)
    body = _body(text, layout, where)
    frame = _parse(body.text, layout, where)
    # Spreadsheets end in lines of delimiters alone: no sample was ever there.
    filled = frame.notna().any(axis=1).to_numpy()
    frame, lines = frame[filled], body.lines[filled]
    columns: list[Column] = []
    texts: dict[str, str] = {}
    notes = [f"Preamble: {line}" for line in layout.preamble]
    findings = _ragged_lines(body, layout, where)
    for index in range(layout.width):
        name = layout.names[index] if index < len(layout.names) else ""
        values = read_values(frame.iloc[:, index], layout.decimal)
        if isinstance(values, str):
            if values or name:
                texts[name or f"column {index + 1}"] = values
            continue
        if values.unreadable is None and not np.isfinite(values.numbers).any():
            if name:
                texts[name] = ""
            continue
        if index >= len(layout.names):
            raise InputError(
                f"The header names {len(layout.names)} columns, the lines of data have "
                f"{index + 1} or more.",
                where=where,
                remedy="Give each column one name, in the order of the data.",
            )
        name = name or f"column {index + 1}"
        label, unit = split_name(name)
        if unit is None and layout.units is not None:
            unit = layout.units[index]
        columns.append(
            Column(name, label, "s" if values.is_time else unit, values.numbers, values.note)
        )
        finding = unreadable_cells(values, name, lines, where)
        findings += [finding] if finding else []
    if not columns or not any(np.isfinite(column.values).any() for column in columns):
        raise InputError(
            "Expected at least one line of numbers, found none.",
            where=where,
            remedy="Check that the export contains the samples.",
        )
    reader = f"text, {layout.description}, {encoding}"
    return Table(tuple(columns), texts, {}, tuple(notes), tuple(findings), reader)


def _parse(body: str, layout: Layout, where: str) -> pd.DataFrame:
    """Return the cells of the body; columns that are not all numbers stay texts."""
    try:
        return pd.read_csv(
            io.StringIO(body),
            sep=r"\s+" if layout.delimiter == " " else layout.delimiter,
            decimal=layout.decimal,
            header=None,
            names=list(range(layout.width)),
            index_col=False,
            keep_default_na=False,
            na_values=PARSED_AS_MISSING,
            skipinitialspace=True,
            low_memory=False,  # one type for a column, not one for each piece of it
            float_precision="round_trip",
        )
    except (pd.errors.ParserError, pd.errors.EmptyDataError, ValueError, OverflowError) as error:
        raise InputError(
            f"The lines of data could not be split into cells ({error}).",
            where=where,
            remedy="Look for a quotation mark that is not closed.",
        ) from error


def _body(text: str, layout: Layout, where: str) -> _Body:
    """Return the lines of data with the right number of cells.

    Counted on bytes with array operations: a million lines take a fraction of a second.
    """
    offset = 0
    for _ in range(layout.first_line):
        offset = text.find("\n", offset) + 1
    body = text[offset:]
    raw = np.frombuffer((body + "\n").encode("utf-8", "replace"), dtype=np.uint8)
    ends = np.flatnonzero(raw == ord("\n"))
    starts = np.concatenate(([0], ends[:-1] + 1))
    blank = (raw == ord(" ")) | (raw == ord("\t"))
    solid = np.concatenate(([0], np.cumsum(~blank & (raw != ord("\n")), dtype=np.int64)))
    is_empty = solid[ends] == solid[starts]
    quotes = np.flatnonzero(raw == ord('"'))
    quotes_before = np.searchsorted(quotes, starts)
    balanced = (np.searchsorted(quotes, ends) - quotes_before) % 2 == 0

    if layout.delimiter == " ":
        gap = blank | (raw == ord("\n"))
        marks = np.flatnonzero(~gap & np.concatenate(([True], gap[:-1])))
        expected = layout.width
    else:
        marks = np.flatnonzero(raw == ord(layout.delimiter))
        expected = layout.width - 1
    if quotes.size:
        line_of_mark = np.searchsorted(ends, marks)
        inside = (np.searchsorted(quotes, marks) - quotes_before[line_of_mark]) % 2 == 1
        marks = marks[~inside]
    counts = np.searchsorted(marks, ends) - np.searchsorted(marks, starts)
    good = (counts == expected) & balanced & ~is_empty
    ragged = ~good & ~is_empty
    numbers = np.arange(ends.size) + layout.first_line + 1
    if not good.any() or ragged.sum() > max(1, RAGGED_LIMIT * good.sum()):
        raise InputError(
            f"{int(ragged.sum())} of {int((good | ragged).sum())} lines of data have not "
            f"{layout.width} cells; the first is line {int(numbers[ragged][0])}.",
            where=where,
            remedy="Export with one delimiter and the same number of cells in every line.",
        )
    if not good.all():
        kept = body.split("\n")
        body = "\n".join([kept[index] for index in np.flatnonzero(good)])
    return _Body(body, numbers[good], numbers[ragged])


def _ragged_lines(body: _Body, layout: Layout, where: str) -> list[Finding]:
    if body.ragged.size == 0:
        return []
    first = ", ".join(str(line) for line in body.ragged[:5])
    more = " and more" if body.ragged.size > 5 else ""
    return [
        Finding(
            id="ragged_rows",
            severity="warning",
            message=f"{body.ragged.size} lines have not {layout.width} cells and are left out: "
            f"line {first}{more}.",
            where=where,
            remedy="Export again if these samples matter.",
            values={"count": body.ragged.size, "first_line": int(body.ragged[0])},
        )
    ]
