"""A report as a file: what it is called, and how it is written as PDF, JSON and CSV.

In the PDF numbers have the digits that are read and words fit their cells; the tables as CSV are
safe to open in a spreadsheet.

Its name is the test type, name and date of the test, and its running number.
"""

from __future__ import annotations

import csv
import datetime
import hashlib
import io
import json
import math
import re
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from importlib.metadata import version
from pathlib import Path
from typing import Any

from heatrun.errors import InputError
from heatrun.io.quantities import plain, with_breaks
from heatrun.io.texts import Texts
from heatrun.io.whole_files import names_begun, without_folders
from heatrun.readers.dates import CLOCK_OF_DAY as CLOCK
from heatrun.record.record import Record
from heatrun.reports.figures import again, save
from heatrun.reports.pdf import typeset
from heatrun.reports.printed import fixed, ranked, told

from .report import CARDS, Cell, Kind, Line, Report, Row, Table

TEMPLATE = resources.files("heatrun_reports") / "report.typ"
LONGEST_TEXT = 900
"""Characters of a text in the PDF; a longer one ends in an ellipsis, the JSON holds all of it."""

LONGEST_VALUE = 28
"""Characters of a word in the column of the values; a longer one stands among the notes."""

BREAKS_EVERY = 40
"""Letters of a long word after which it may break, where it has no sign to break behind."""

SMALLEST_PLAIN, LARGEST_PLAIN = 1e-3, 1e6
"""Numbers outside have three digits; far outside, a power of ten."""


def write_pdf(
    report: Report, content: Mapping[str, Any], path: Path, say: Texts | None = None
) -> Path:
    """Draw the figures of a report and set it as PDF.

    Args:
        report: What is to be set.
        content: As `heatrun_reports.document.report_content`, with `"report"`, the
            file's name.
        path: Where it goes; written whole or not at all.
        say: The texts in the language of the report; None for English.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        say = say or Texts()
        texts = document_content(report, content, say)
        figures = [
            save(again(drawing.draw(), say), folder / f"{number:03d}.png")
            for number, drawing in enumerate(report.drawings)
        ]
        return typeset(TEMPLATE, texts, figures, path)


def document_content(
    report: Report, content: Mapping[str, Any], say: Texts | None = None
) -> dict[str, Any]:
    """Return the texts of the PDF, each cell as it is printed; as `write_pdf`."""
    say = say or Texts()
    basis = say.again(content.get("date_from") or "")
    dated = f"{content['date']} ({basis})" if content.get("date") else say.again("not known")
    texts = {
        "version": f"heatrun {version('heatrun')}",
        "title": report.title,
        "heading": CARDS[report.kind].heading,
        "test": report.test,
        "summary": report.summary,
        "meta": [["Motor", report.motor], ["Date of the test", dated]]
        + [
            [
                "File" if number == 0 else "and",
                f"{source.path} · SHA-256 {source.sha256[:16]}… · {source.reader}",
            ]
            for number, source in enumerate(report.sources)
        ],
        "rows": [_row(row) for row in report.rows],
        "tables": [_printed_table(table) for table in report.tables],
        "captions": [drawing.caption for drawing in report.drawings],
        "findings": [[f.severity, told(f, say)[0]] for f in ranked(report.findings)],
        "definitions": [[name, text] for name, text in report.definitions],
    }
    said = _again(texts, say)
    if say.is_whole and all(told(f, say)[1] for f in report.findings):
        said["remark"] = ""
    return _printed(said, [source.path for source in report.sources])


def _again(texts: Mapping[str, Any], say: Texts) -> dict[str, Any]:
    """Return the texts of a report in another language, as far as the table has them."""

    def rows(key: str, *as_given: int) -> list[list[str]]:
        return [
            [text if place in as_given else say.again(text) for place, text in enumerate(row)]
            for row in texts[key]
        ]

    return {
        **texts,
        **{key: say.again(texts[key]) for key in ("title", "heading")},
        "summary": " ".join(map(say.again, re.split(r"(?<=\.) ", texts["summary"]))),
        "meta": rows("meta", 1),
        "rows": rows("rows", 2),
        "definitions": rows("definitions"),
        "captions": [say.again(text) for text in texts["captions"]],
        "findings": [[say(severity), text] for severity, text in texts["findings"]],
        "tables": [
            {
                "title": say.again(table["title"]),
                "head": [say.again(text) for text in table["head"]],
                "lines": [[say.again(text) for text in line] for line in table["lines"]],
                "notes": [": ".join(map(say.again, note)) for note in table["notes"]],
            }
            for table in texts["tables"]
        ],
        "labels": {key: say(key) for key in ("findings", "definitions", "page", "of")},
        "remark": say("rest_in_english"),
    }


def _printed(value: Any, paths: Sequence[str]) -> Any:
    """Return texts as they are printed, at any depth of lists and objects."""
    if isinstance(value, str):
        return printed(without_folders(value, paths))
    if isinstance(value, Mapping):
        return {key: _printed(item, paths) for key, item in value.items()}
    return [_printed(item, paths) for item in value]


def number(value: Cell, places: int | None = None) -> str:
    """Return a cell as it is printed: a text as it is, five digits, a dash where it is undefined.

    Args:
        value: Of the cell.
        places: Decimal places that its uncertainty leaves, negative for tens; None for five digits.

    Example:
        >>> number(0.0039), number(247.11654), number(None), number(-0.0)
        ('0.0039', '247.12', '–', '0')
        >>> number(204.078, 1), number(712.13, 0), number(4711.0, -1), number(-0.01, 1)
        ('204.1', '712', '4710', '0.0')
    """
    if isinstance(value, str):
        return value
    if value is None or not math.isfinite(value):
        return "–"
    if places is not None:
        return fixed(value, places)
    if value == 0.0:
        return "0"
    if not SMALLEST_PLAIN <= abs(value) < LARGEST_PLAIN:
        return plain(value, 3)
    places = max(0, 4 - math.floor(math.log10(abs(value))))
    text = f"{value:.{places}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def printed(text: str) -> str:
    """Return a text without control characters, of bounded length, with breaks in long words."""
    plain = "".join(c if c.isprintable() else " " for c in text)
    if len(plain) > LONGEST_TEXT:
        plain = plain[: LONGEST_TEXT - 1] + "…"
    return with_breaks(plain, BREAKS_EVERY)


def _row(row: Row) -> list[str]:
    value, note = number(row.value, row.places), row.note
    if len(value) > LONGEST_VALUE:  # it would take the room of the notes
        value, note = "", f"{value}; {note}" if note else value
    return [row.label, value, row.unit, note]


def _printed_table(table: Table) -> dict[str, Any]:
    head = [_with_unit(column.label, column.unit) for column in table.columns]
    lines = [[_with_unit(line.name, line.unit), *_short_cells(line)] for line in table.lines]
    notes = [(line.name, line.note) for line in table.lines if line.note]
    return {
        "title": table.title,
        "head": ["", *head],
        "lines": lines,
        "notes": [*notes, (table.note,)] if table.note else notes,
    }


def _with_unit(name: str, unit: str | None) -> str:
    return name if unit in (None, "", "1") else f"{name} [{unit}]"


def _short_cells(line: Line) -> list[str]:
    places = line.places or (None,) * len(line.cells)
    return [
        _short(cell) if each is None else number(cell, each)
        for cell, each in zip(line.cells, places, strict=True)
    ]


def _short(value: Cell) -> str:
    """A cell of a table with many columns: four digits."""
    if isinstance(value, float) and math.isfinite(value) and 1e-3 <= abs(value) < 1e5:
        places = max(0, 3 - math.floor(math.log10(abs(value))))
        return f"{value:.{min(places, 4)}f}"
    return number(value)


def report_content(report: Report, when: DateOfTest | None) -> dict[str, Any]:
    """Return all that a report says, as numbers and texts.

    Args:
        report: Any report.
        when: Date of the test and how it is known; None where it is not.
    """
    return {
        "format": "heatrun-report/1",
        "type": report.kind,
        "title": report.title,
        "test": report.test,
        "motor": report.motor,
        "date": when.day.isoformat() if when else None,
        "date_from": when.basis if when else None,
        "summary": report.summary,
        "table": [
            {"name": r.name, "label": r.label, "value": r.value, "unit": r.unit, "note": r.note}
            for r in report.rows
        ],
        "tables": [_table(table) for table in report.tables],
        "findings": ranked(report.findings),
        "definitions": [{"name": name, "text": text} for name, text in report.definitions],
        "channels": list(report.channels),
        "sources": [
            {"path": s.path, "sha256": s.sha256, "reader": s.reader} for s in report.sources
        ],
    }


def _table(table: Table) -> dict[str, Any]:
    return {
        "title": table.title,
        "note": table.note,
        "lines": [
            {
                "name": line.name,
                "note": line.note,
                "cells": [
                    {
                        "quantity": column.label,
                        "value": cell,
                        "unit": line.unit if column.unit is None else column.unit,
                    }
                    for column, cell in zip(table.columns, line.cells, strict=True)
                ],
            }
            for line in table.lines
        ],
    }


HEAD = ("table", "of", "quantity", "value", "unit", "note")

FORMULA = re.compile(r"(^|[;\t\r\n|])(\s*)(?=[=+\-@\uFF1D\uFF0B\uFF0D\uFF20])")
"""Where a spreadsheet would see the beginning of a formula: at the start of a cell, and behind what
another locale takes for a delimiter; the last four are the full-width forms."""


def csv_table(report: Report) -> str:
    """Return all tables of a report, one figure a line.

    Numbers stay numbers, whatever their sign; texts that a spreadsheet would take for a formula get
    an apostrophe in front of it. What is undefined is an empty cell with its reason in the note.

    Args:
        report: Any report.
    """
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(HEAD)
    for row in report.rows:
        writer.writerow(_cells(report.title, report.test, row.label, row.value, row.unit, row.note))
    for table in report.tables:
        for line in table.lines:
            for column, cell in zip(table.columns, line.cells, strict=True):
                unit = line.unit if column.unit is None else column.unit
                writer.writerow(_cells(table.title, line.name, column.label, cell, unit, line.note))
    return stream.getvalue()


def neutral(text: str) -> str:
    """Return a text in which no spreadsheet sees a formula or a line of its own."""
    plain = "".join(c if c.isprintable() else " " for c in text)
    return FORMULA.sub(r"\1\2'", plain)


def _cells(*cells: Cell) -> list[str]:
    return [_cell(cell) for cell in cells]


def _cell(cell: Cell) -> str:
    if isinstance(cell, str):
        return neutral(cell)
    return "" if cell is None or not math.isfinite(cell) else f"{cell:.10g}"


IN_NAME = re.compile(
    r"(?<!\d)(?P<year>20\d\d)[_\-.]?(?P<month>0[1-9]|1[0-2])[_\-.]?(?P<day>0[1-9]|[12]\d|3[01])"
    r"(?P<rest>(?:[_\-.]\d{1,6})*)(?!\d)"
)
FILE_NAME = "file name"

UNDATED = "undated"
"""Stands in the name of a report where neither the test's name nor its date says anything."""

GENERIC = "test"
"""What the bench calls any test; it says nothing beside the test type."""

LONGEST_NAME = 60
"""Letters of a test's name that are kept."""

MOST_REPORTS = 999


@dataclass(frozen=True)
class DateOfTest:
    """When a test was run, and how that is known.

    Attributes:
        day: The date.
        number: Running number or clock time as the file name writes it behind the date, such as
            `"001"` or `"14_16_08"`; empty if there is none.
        basis: `"clock of the record"`, `"header of the file"` or `FILE_NAME`.
    """

    day: datetime.date
    number: str
    basis: str


def date_of_test(path: Path, record: Record) -> DateOfTest | None:
    """Return the date of a test: that of its record, else the one in the name of its file.

    The time at which a file was last changed says when it was copied, and nothing of the test.

    Args:
        path: The bench file; of two joined by `+`, the first.
        record: What was read from it.
    """
    first = path if path.exists() else Path(str(path).partition("+")[0].partition("@")[0])
    for found in IN_NAME.finditer(first.name):
        day = _day(int(found["year"]), int(found["month"]), int(found["day"]))
        if day is not None and record.start in ("", day.isoformat()):
            number = re.sub(r"[\-.]", "_", found["rest"].strip("_-."))
            basis = (record.start_from or CLOCK) if record.start else FILE_NAME
            return DateOfTest(day, number, basis)
    return date_of_record(record)


def date_of_record(record: Record) -> DateOfTest | None:
    """Return the date that a record has of its own; None if it has none."""
    if not record.start:
        return None
    return DateOfTest(datetime.date.fromisoformat(record.start), "", record.start_from or CLOCK)


def name_of_test(test: str) -> str:
    """Return what the name of a test says beside its date and number; empty for nothing.

    Args:
        test: Its name, such as `"pump 3_2022_12_07_001"`.

    Example:
        >>> name_of_test("pump 3_2022_12_07_001"), name_of_test("Test_2022_12_07_001")
        ('pump_3', '')
    """

    def kept(found: re.Match) -> str:
        is_date = _day(int(found["year"]), int(found["month"]), int(found["day"])) is not None
        return "_" if is_date else found[0]

    words = re.sub(r"[^\w\-]+", "_", IN_NAME.sub(kept, test)).strip("_-")
    return "" if words.casefold() == GENERIC else words[:LONGEST_NAME].rstrip("_-")


def choose_name(
    folder: Path, kind: Kind, when: DateOfTest | None, identity: list[str], test: str = ""
) -> str:
    """Return the name of the report of a test, without its ending: its former one, or a free one.

    A PDF without a JSON of heatrun's beside it is someone else's. A report that another process
    is writing has its name too; the same one, made of the same files, is replaced by the later.

    Args:
        folder: Of the reports; nobody else may choose a name in it in the meantime.
        kind: Test type.
        when: Date and number of the test; None where the date is not known.
        identity: Digests of the files behind the report; one with the same is overwritten.
        test: Name of the test.

    Raises:
        InputError: If a thousand reports of this day, or undated ones, are there already.
        OSError: If the folder cannot be read.
    """
    words = name_of_test(test)
    day = "" if when is None else f"{when.day:%Y_%m_%d}"
    known = [words, day, "" if when is None else when.number]
    begun = names_begun(folder, CARDS[kind].stem)
    for end in _ends(is_numbered=bool(words or known[-1])):
        parts = [CARDS[kind].stem, *filter(None, known)]
        name = "_".join(parts if words or day else [*parts, UNDATED]) + end
        others = {n for n in begun if n.partition(".")[0] == name} - {set_name(name, identity)}
        taken = [folder / f"{name}{ending}" for ending in (".pdf", ".csv", ".json")]
        if others or (any(path.exists() for path in taken) and _identity(taken[-1]) != identity):
            continue
        return name
    raise InputError(
        f"{MOST_REPORTS} reports of this test type and day are there already.",
        where=str(folder),
        remedy="Choose another folder with --out.",
    )


def _ends(*, is_numbered: bool) -> Iterator[str]:
    """Give the running numbers of a day; behind a name or number of the test's own `-2`, `-3`."""
    if not is_numbered:
        yield from (f"_{number:03d}" for number in range(1, MOST_REPORTS + 1))
        return
    yield ""
    yield from (f"-{number}" for number in range(2, MOST_REPORTS + 1))


def set_name(name: str, identity: list[str]) -> str:
    """Return the name of the files of a report together, which says what they are made of."""
    return f"{name}.{hashlib.sha256(json.dumps(identity).encode()).hexdigest()[:16]}"


def _identity(path: Path) -> list[str] | None:
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return content.get("identity") if isinstance(content, dict) else None


def _day(year: int, month: int, day: int) -> datetime.date | None:
    try:
        return datetime.date(year, month, day)
    except ValueError:
        return None
