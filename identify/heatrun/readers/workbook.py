"""Reader of Excel workbooks, as the text reader reads a table; needs the extra `heatrun[excel]`.

The cells of the sheet that is a test become lines of text. A number is written without a decimal
sign, as `225e-1`: it then counts under either sign, and what the text reader finds out about
decimal signs rests on the cells of text alone.
"""

import contextlib
import io
import re
import zipfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import date, datetime, time, timedelta
from typing import Any

from ..errors import InputError, did_you_mean
from ..io.open_file import LARGEST_BYTES, LARGEST_NUMBERS
from ..record.channels import CHANNEL, REQUIRED
from ..record.record import Finding
from ..record.table import Column, Table
from .channel_map import map_columns
from .foreign import BrokenFileError, library, reading
from .text.reader import NO_HINTS, Hints, read_text
from .text.remarks import units_of_row

WHAT = "an Excel workbook"
WORKBOOK, BINARY_WORKBOOK = "xl/workbook.xml", "xl/workbook.bin"
DAY_S = 86400.0
FIRST_YEAR = 1900
"""Times beyond 24 h that are formatted as times of day come as dates of this year."""

MOST_ROWS = 2**20
"""As many as a sheet may have."""

MOST_CELLS = LARGEST_NUMBERS // 8
"""Each takes some hundred bytes of memory until the table is read."""

HEADER_ROWS = 40
"""Merged cells are looked at as far down as names and units stand."""


@dataclass(frozen=True)
class Sheet:
    """A sheet of an open workbook of the library's."""

    name: str  # As on its tab.
    is_hidden: bool
    where: str  # The file, for messages.
    book: Any
    opened: Any

    def lines(self, most: int | None = None) -> tuple[str, str]:
        """Return its cells as lines with tabs between, and the first formula without a value.

        Columns that hold nothing anywhere are left out. Of so many rows at most; then without
        merged cells.

        Raises:
            InputError: If the sheet is damaged, or holds more than memory is meant to.
        """
        with reading(f"{WHAT} with the sheet '{self.name}'", self.where):
            return _lines(self, most)


@contextlib.contextmanager
def open_workbook(data: bytes, where: str) -> Iterator[tuple[Sheet, ...]]:
    """Open a workbook for the time of the context, to its sheets in their order.

    Raises:
        InputError: If it is no workbook, damaged, or the library for it is missing.
    """
    with reading(WHAT, where):
        _check(data, where)
    openpyxl = library("openpyxl", "Excel", where)
    with reading(WHAT, where):
        book: Any = openpyxl.load_workbook(io.BytesIO(data), read_only=True, data_only=True)
        sheets = tuple(
            Sheet(one.title, one.sheet_state != "visible", where, book, one)
            for one in book.worksheets
        )
    try:
        yield sheets
    finally:
        book.close()


def _check(data: bytes, where: str) -> None:
    """Refuse what is no workbook, and one that unpacks to more than memory is meant to hold."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            names = set(archive.namelist())
            size = sum(one.file_size for one in archive.infolist())
    except (zipfile.BadZipFile, EOFError, ValueError, NotImplementedError) as error:
        raise BrokenFileError(f"damaged or cut: {error}") from error
    if WORKBOOK not in names:
        got, remedy = "a binary workbook", "Save it as .xlsx."
        if BINARY_WORKBOOK not in names:
            got = "a zip archive or another spreadsheet"
            remedy = "Unpack it, or save it as .xlsx or CSV."
        problem = f"Expected CSV, MAT, Parquet, MDF, TDMS or Excel, got {got}."
        raise InputError(problem, where=where, remedy=remedy)
    if size > LARGEST_BYTES:
        raise BrokenFileError(f"{size} bytes unpacked, more than the {LARGEST_BYTES} that are read")


def _lines(sheet: Sheet, most: int | None) -> tuple[str, str]:
    from openpyxl.utils import get_column_letter
    from openpyxl.worksheet._reader import FORMULA_TAG, VALUE_TAG, WorkSheetParser

    class Parser(WorkSheetParser):
        """Also says which cells hold formulas, and whether their values are there."""

        def parse_cell(self, element):
            cell = super().parse_cell(element)
            if element.find(FORMULA_TAG) is not None:
                has_value = element.findtext(VALUE_TAG) or element.get("t") == "str"
                cell["formula"] = "calculated" if has_value else "not calculated"
            return cell

    book = sheet.book
    held: dict[int, dict[int, str]] = {}
    formulas: list[tuple[str, Any]] = []
    uncalculated = ""
    with sheet.opened._get_source() as source:
        parser = Parser(
            source, sheet.opened._shared_strings, data_only=True, epoch=book.epoch,
            date_formats=book._date_formats, timedelta_formats=book._timedelta_formats,
        )  # fmt: skip
        num_cells = 0
        for row, cells in parser.parse():
            if most is not None and row > most:
                break
            for cell in cells:
                place = cell["column"]
                if "formula" in cell:
                    at = f"{get_column_letter(place)}{row}"
                    formulas.append((at, cell["value"]))
                    if cell["formula"] != "calculated":
                        uncalculated = uncalculated or at
                text = as_text(cell["value"], book.epoch)
                if text:
                    held.setdefault(row, {})[place] = text
                    num_cells += 1
            if row > MOST_ROWS or num_cells > MOST_CELLS:
                raise BrokenFileError(
                    f"more than the {MOST_ROWS} rows or {MOST_CELLS} cells that are read"
                )
        merged = parser.merged_cells
    if formulas and not uncalculated and getattr(book.calculation, "fullCalcOnLoad", False):
        # a program that leaves the calculation to Excel writes 0 into each
        uncalculated = formulas[0][0] if all(value == 0 for _, value in formulas) else ""
    _fill_names(held, merged)
    rows = _dense(held)

    def quoted(cell: str) -> str:
        return '"' + cell.replace('"', '""') + '"' if '"' in cell else cell

    text = "\n".join("\t".join(quoted(cell) for cell in row) if any(row) else "" for row in rows)
    return text, uncalculated


def _fill_names(held: dict[int, dict[int, str]], merged: Any) -> None:
    """Let a name that stands over several rows stand in the last of them, if that is of names."""
    for area in getattr(merged, "mergeCell", ()) or ():
        last, column = area.max_row, area.min_col
        if not area.min_row < last <= HEADER_ROWS or column not in held.get(area.min_row, {}):
            continue
        row = held.get(last, {})
        if row and units_of_row([row.get(place, "") for place in range(1, max(row) + 1)]) is None:
            row.setdefault(column, held[area.min_row][column])


def _dense(held: dict[int, dict[int, str]]) -> tuple[tuple[str, ...], ...]:
    """Return rows of one length, without columns that hold nothing."""
    columns = sorted({column for row in held.values() for column in row})
    num_rows = max(held, default=0)
    if num_rows * len(columns) > LARGEST_NUMBERS:
        raise BrokenFileError(f"more than the {LARGEST_NUMBERS} cells that are read")
    empty: dict[int, str] = {}
    blank = ("",) * len(columns)
    return tuple(
        tuple(row.get(column, "") for column in columns) if (row := held.get(i, empty)) else blank
        for i in range(1, num_rows + 1)
    )


def as_text(value: Any, epoch: datetime) -> str:
    """Return what a cell holds, as the text reader takes it; `epoch` is day 0 of the workbook."""
    from openpyxl.utils.datetime import to_excel

    if value is None:
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return _without_sign(value)
    if isinstance(value, datetime):
        if value.year <= max(FIRST_YEAR, epoch.year):
            return _clock(float(to_excel(value, epoch)) * DAY_S)
        return value.isoformat()
    if isinstance(value, date):
        return f"{value.isoformat()}T00:00:00"
    if isinstance(value, time):
        since = timedelta(0, value.second, value.microsecond, 0, value.minute, value.hour)
        return _clock(since.total_seconds())
    if isinstance(value, timedelta):
        return _clock(value.total_seconds())
    return " ".join(str(value).split())


def _without_sign(value: float) -> str:
    """Return a number as digits and a power of ten; it reads back as the same number."""
    mantissa, _, exponent = repr(value).partition("e")
    whole, _, fraction = mantissa.partition(".")
    fraction = fraction.rstrip("0")
    power = int(exponent or 0) - len(fraction)
    return f"{whole}{fraction}e{power}" if power else f"{whole}{fraction}"


def _clock(seconds: float) -> str:
    """Return a time as hours, minutes and seconds to the microsecond; hours may be beyond 24."""
    rest, micros = divmod(round(abs(seconds) * 1e6), 1_000_000)
    minutes, whole = divmod(rest, 60)
    sign = "-" if seconds < 0 else ""
    return f"{sign}{minutes // 60}:{minutes % 60:02d}:{whole:02d}.{micros:06d}"


PREVIEW_ROWS = 400
"""Rows of each sheet that say which one holds the test."""

PLAIN = re.compile(r"(?<![\w.,])-?[0-9]+e-?[0-9]+(?![\w.,])")


def read_excel(data: bytes, where: str, hints: Hints = NO_HINTS) -> Table:
    """Read a sheet of a workbook, .xlsx or .xlsm.

    The sheet is the one that the test names (`FILE.xlsx#SHEET`) or that `[columns]` names
    (`"SHEET/COLUMN"`), else the one with the most channels that a fit needs. It is read as a text
    table, formulas with the values that the workbook keeps, dates and times in seconds.

    Raises:
        InputError: If the workbook is damaged, has no such sheet, no sheet or several with a test,
            or a formula without its value.
    """
    with open_workbook(data, where) as sheets:
        sheet, others = _chosen(sheets, where, hints)
        text, uncalculated = sheet.lines()
    if uncalculated:
        raise InputError(
            f"Cell {uncalculated} of sheet '{sheet.name}' holds a formula whose value was "
            "never calculated.",
            where=where,
            remedy="Open the workbook in Excel or LibreOffice, save it there, and read it again.",
        )
    table = _table(text, _at(where, sheet, sheets), hints)
    columns = tuple(_asked_with_sheet(column, sheet.name, hints) for column in table.columns)
    findings = (*table.findings, *_other_sheets(sheet, others, where))
    notes = tuple(  # numbers and cells as a person writes them
        " ".join(PLAIN.sub(lambda found: f"{float(found[0]):g}", note).split())
        for note in table.notes
    )
    reader = f"Excel, sheet '{sheet.name}'"
    return replace(table, columns=columns, findings=findings, notes=notes, reader=reader)


def _table(text: str, where: str, hints: Hints) -> Table:
    # the mark in front settles the encoding
    return read_text(f"\ufeff{text}".encode(), where, hints, delimiters=("\t",))


def _at(where: str, sheet: Sheet, sheets: Sequence[Sheet]) -> str:
    return where if len(sheets) == 1 else f"{where}, sheet '{sheet.name}'"


def _chosen(sheets: Sequence[Sheet], where: str, hints: Hints) -> tuple[Sheet, list[str]]:
    """Return the sheet of the test, and the names of others that could be one too."""
    asked = hints.sheet or next(
        (one.name for one in sheets for claim in hints.claims
         if claim.text.startswith(f"{one.name}/")), None
    )  # fmt: skip
    if asked is not None:
        for sheet in sheets:
            if sheet.name == asked:
                return sheet, []
        names = [sheet.name for sheet in sheets]
        raise InputError(
            f"The workbook has no sheet '{asked}'. {did_you_mean(asked, names)}".strip(),
            where=where,
            remedy=f"Its sheets are: {', '.join(names)}.",
        )
    visible = [sheet for sheet in sheets if not sheet.is_hidden] or list(sheets)
    if len(visible) == 1:
        return visible[0], []
    scores: dict[str, int] = {}
    reasons = []
    for sheet in visible:
        try:
            scores[sheet.name] = _num_needed(sheet, _at(where, sheet, sheets), hints)
        except InputError as error:
            reasons.append(f"{sheet.name}: {error.problem}")
    if not scores:
        raise InputError(
            f"None of the sheets holds a table of numbers below a row of names ({reasons[0]})"
            if reasons
            else "The workbook has no sheets.",
            where=where,
            remedy="Check that the workbook contains the samples.",
        )
    best = [name for name, score in scores.items() if score == max(scores.values())]
    if len(best) > 1:
        raise InputError(
            f"The sheets {' and '.join(repr(name) for name in best)} may each be the test.",
            where=where,
            remedy=f"Name the sheet behind the file: '{where}#{best[0]}'.",
        )
    sheet = next(sheet for sheet in visible if sheet.name == best[0])
    return sheet, [name for name in scores if name != sheet.name]


def _num_needed(sheet: Sheet, where: str, hints: Hints) -> int:
    """Return how many channels that a fit needs the first rows of a sheet have.

    Raises:
        InputError: If they are no table.
    """
    table = _table(sheet.lines(PREVIEW_ROWS)[0], where, hints)
    columns = {claim.channel: claim.text for claim in hints.claims}
    try:
        found = map_columns(table, columns, where=where, is_part=True).channels
    except InputError as error:  # a question about a column that it has
        return sum(name in str(error) for name in REQUIRED)
    return sum(name in found for name in REQUIRED) * len(CHANNEL) + len(found)


def _asked_with_sheet(column: Column, sheet: str, hints: Hints) -> Column:
    """Return a column under the name `SHEET/COLUMN` where `[columns]` asks for it so."""
    asked = {text for claim in hints.claims for text in (claim.text, claim.base, claim.label)}
    if not {f"{sheet}/{column.name}", f"{sheet}/{column.label}"} & asked:
        return column
    return replace(
        column,
        name=f"{sheet}/{column.name}",
        label=f"{sheet}/{column.label}",
        heading=column.heading or column.name,
    )


def _other_sheets(sheet: Sheet, others: Sequence[str], where: str) -> Iterator[Finding]:
    if others:
        yield Finding(
            "sheet_chosen",
            "note",
            f"Sheet '{sheet.name}' is read, which has the most of the channels needed; "
            f"tables stand in {', '.join(repr(name) for name in others)} too.",
            where,
            f"To read another one: '{where}#{others[0]}'.",
            values={"count": len(others)},
        )
