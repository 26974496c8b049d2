"""The table of a fleet's machines: CSV with any of three delimiters, or Parquet."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from heatrun.bench.readers.open_file import read_start
from heatrun.errors import InputError

from .entries import ALIASES, BETWEEN, Row

LARGEST_BYTES = 2**28
"""Largest table; a million machines of 200 letters have 200 MB."""

LONGEST_CELL = 10_000
"""Letters of a cell; twenty tests with their folders have 2000."""

DELIMITERS = (",", ";", "\t")


def read_manifest(path: str | Path) -> tuple[list[str], list[Row]]:
    """Read the table of the machines.

    Args:
        path: A file that ends in `.parquet`, or text of columns between commas, semicolons or tabs
            with a heading.

    Returns:
        The names of the columns, `ALIASES` resolved, and the rows, blank ones left out. A row that
        has too many cells or one that is too long has a problem.

    Raises:
        InputError: If the file cannot be read, is no table, or holds no row.
    """
    where = str(path)
    data = read_start(path, LARGEST_BYTES)
    if len(data) > LARGEST_BYTES:
        raise InputError(
            f"Expected a table of at most {LARGEST_BYTES // 2**20} MB, got more.",
            where=where,
            remedy="Check that this is the table of the machines; or make several fleets.",
        )
    is_parquet = data[:4] == b"PAR1"
    names, rows = _of_parquet(data, where) if is_parquet else _of_text(data, where)
    names = [ALIASES.get(name, name) for name in names]
    rows = [
        Row(row.place, {ALIASES.get(k, k): v for k, v in row.cells.items()}, row.problem)
        for row in rows
        if row.cells or row.problem
    ]
    if not rows:
        raise InputError(
            "Expected at least one row with a machine, found none.",
            where=where,
            remedy="Write a row for each machine: its name and its tests.",
        )
    return names, rows


def _of_text(data: bytes, where: str) -> tuple[list[str], list[Row]]:
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(
            f"Expected UTF-8 text, got another byte at position {error.start}.",
            where=where,
            remedy="Save the table as UTF-8, in spreadsheets as 'CSV UTF-8'.",
        ) from error
    heading = next((line for line in text.splitlines() if line.strip()), "")
    if "\0" in heading:
        raise InputError(
            "Expected a table of machines as text or Parquet, got something else.",
            where=where,
            remedy="Name a file with a heading such as machine,type,test.",
        )
    delimiter = max(DELIMITERS, key=heading.count)
    lines = csv.reader(io.StringIO(text), delimiter=delimiter)
    try:
        names: list[str] = []
        rows: list[Row] = []
        for cells in lines:
            if not any(cell.strip() for cell in cells):
                continue
            if not names:
                names = [cell.strip() for cell in cells]
                continue
            rows.append(_row(f"line {lines.line_num}", names, cells))
    except csv.Error as error:
        raise InputError(
            f"The table cannot be read ({error} in line {lines.line_num}).",
            where=where,
            remedy="Look for a quote that is never closed.",
        ) from error
    return names, rows


def _row(place: str, names: Sequence[str], cells: Sequence[str]) -> Row:
    problem = ""
    if any(cell.strip() for cell in cells[len(names) :]):
        problem = f"Expected {len(names)} cells as in the heading, got {len(cells)}."
    if any(len(cell) > LONGEST_CELL for cell in cells):
        problem = f"A cell has more than {LONGEST_CELL} letters."
        cells = [cell[:LONGEST_CELL] for cell in cells]
    given = zip(names, (cell.strip() for cell in cells), strict=False)
    return Row(place, {name: cell for name, cell in given if cell}, problem)


def _of_parquet(data: bytes, where: str) -> tuple[list[str], list[Row]]:
    try:
        import pyarrow.parquet
    except ImportError as error:
        raise InputError(
            "Reading Parquet needs pyarrow, which is not installed.",
            where=where,
            remedy='Run: pip install "heatrun[fleet]"',
        ) from error
    try:
        table = pyarrow.parquet.ParquetFile(io.BytesIO(data)).read()
        held = table.to_pylist()
    except Exception as error:  # a damaged file raises nearly anything in there
        raise InputError(
            f"Expected a Parquet table, it could not be read ({type(error).__name__}: {error}).",
            where=where,
            remedy="Write the table again.",
        ) from error
    names = list(table.column_names)
    rows = [
        _row(f"row {number}", names, [cell_text(each) for each in row.values()])
        for number, row in enumerate(held, start=1)
    ]
    return names, rows


def cell_text(value: Any) -> str:
    """Return the text of a value from Parquet or TOML; empty for none.

    A list is several tests; a date and a time are written as ISO 8601 has them.
    """
    if value is None:
        return ""
    if isinstance(value, list | tuple):
        return BETWEEN.join(cell_text(each) for each in value)
    if isinstance(value, bool):
        return "true" if value else "false"
    if hasattr(value, "isoformat"):
        return value.isoformat()
    return str(value)
