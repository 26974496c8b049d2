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
from collections.abc import Mapping
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
from heatrun.reports.certificate import ENGLISH
from heatrun.reports.figures import again, save
from heatrun.reports.pdf import in_texts, typeset
from heatrun.reports.printed import fixed, ranked, told

from .report import CARDS, Cell, Kind, Line, Report, Row, Table

TEMPLATE = resources.files("heatrun_reports") / "report.typ"
LONGEST_TEXT = 900
"""Characters of a text in the PDF; a longer one ends in an ellipsis, the JSON holds all of it."""

LONGEST_VALUE = 28
"""Characters of a word in the column of the values; a longer one stands among the notes."""

BREAKS_EVERY = 40
"""Letters of a long word after which it may break, where it has no sign to break behind."""

SNIFFED = ("text", "blanks", "tab", "decimal comma")
"""Words of a reader that are said in each language."""

SMALLEST_PLAIN, LARGEST_PLAIN = 1e-3, 1e6
"""Numbers outside have three digits; far outside, a power of ten."""


def write_pdf(report: Report, content: Mapping[str, Any], path: Path, say: Texts) -> Path:
    """Draw the figures of a report and set it as PDF, whole or not at all, in a language.

    The content is as `report_content` returns it.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        texts = document_content(report, content, say)
        figures = [
            save(again(drawing.draw(), say), folder / f"{number:03d}.png")
            for number, drawing in enumerate(report.drawings)
        ]
        return typeset(TEMPLATE, texts, figures, path)


def document_content(
    report: Report, content: Mapping[str, Any], say: Texts = ENGLISH
) -> dict[str, Any]:
    """Return the texts of the PDF, each cell as it is printed; as `write_pdf`."""
    day, basis = content.get("date"), say.again(content.get("date_from") or "")
    sources = [f"{s.path} · SHA-256 {s.sha256[:16]}… · {_read_as(s.reader, say)}"
               for s in report.sources]  # fmt: skip
    findings = [(say(f.severity), *told(f, say)) for f in ranked(report.findings)]
    said = {
        "version": f"heatrun {version('heatrun')}",
        "title": say.again(report.title),
        "heading": say.again(CARDS[report.kind].heading),
        "test": report.test,
        "summary": " ".join(map(say.again, re.split(r"(?<=\.) ", report.summary))),
        "meta": [
            [say.again("Motor"), report.motor],
            [say.again("Date of the test"), f"{day} ({basis})" if day else say.again("not known")],
            *([say.again("and" if at else "File"), each] for at, each in enumerate(sources)),
        ],
        "rows": [_row(row, say) for row in report.rows],
        "tables": [_printed_table(table, say) for table in report.tables],
        "captions": [say.again(drawing.caption) for drawing in report.drawings],
        "findings": [[severity, text] for severity, text, _ in findings],
        "definitions": [[say.again(name), say.again(text)] for name, text in report.definitions],
        "labels": {key: say(key) for key in ("findings", "definitions", "page", "of")},
    }
    is_whole = say.is_whole and all(is_said for *_, is_said in findings)
    said["remark"] = "" if is_whole else say("rest_in_english")
    paths = [source.path for source in report.sources]
    return in_texts(said, lambda text: printed(without_folders(text, paths)))


def _read_as(reader: str, say: Texts) -> str:
    """Return what a reader sniffed, its words in the language; names of formats stay."""
    words = reader.split(", ")
    return ", ".join(say.again(word) if word in SNIFFED else word for word in words)


def number(value: Cell, places: int | None = None) -> str:
    """Return a cell as it is printed: a text as it is, a dash where it is undefined.

    A number has the decimal places that its uncertainty leaves, negative for tens; or five digits.

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


def _row(row: Row, say: Texts) -> list[str]:
    value, note = number(row.value, row.places), row.note
    if len(value) > LONGEST_VALUE:  # it would take the room of the notes
        value, note = "", f"{value}; {note}" if note else value
    return [say.again(row.label), say.again(value), row.unit, say.again(note)]


def _printed_table(table: Table, say: Texts) -> dict[str, Any]:
    def named(name: str, unit: str | None) -> str:
        return say.again(name if unit in (None, "", "1") else f"{name} [{unit}]")

    lines = [
        [named(line.name, line.unit), *(say.again(cell) for cell in _short_cells(line))]
        for line in table.lines
    ]
    notes = [f"{say.again(x.name)}: {say.again(x.note)}" for x in table.lines if x.note]
    return {
        "title": say.again(table.title),
        "head": ["", *(named(column.label, column.unit) for column in table.columns)],
        "lines": lines,
        "notes": [*notes, say.again(table.note)] if table.note else notes,
    }


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
    """Return all that a report says, as numbers and texts, with the date of the test if known."""
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
        "tables": [
            {
                "title": table.title,
                "note": table.note,
                "lines": [
                    {
                        "name": line.name,
                        "note": line.note,
                        "cells": [
                            {"quantity": quantity, "value": value, "unit": unit}
                            for quantity, value, unit in table.cells(line)
                        ],
                    }
                    for line in table.lines
                ],
            }
            for table in report.tables
        ],
        "findings": ranked(report.findings),
        "definitions": [{"name": name, "text": text} for name, text in report.definitions],
        "channels": list(report.channels),
        "sources": [
            {"path": s.path, "sha256": s.sha256, "reader": s.reader} for s in report.sources
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
    """
    lines = [(report.title, report.test, r.label, r.value, r.unit, r.note) for r in report.rows]
    lines += [
        (table.title, line.name, *cell, line.note)
        for table in report.tables
        for line in table.lines
        for cell in table.cells(line)
    ]
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(HEAD)
    writer.writerows([_cell(each) for each in line] for line in lines)
    return stream.getvalue()


def neutral(text: str) -> str:
    """Return a text in which no spreadsheet sees a formula or a line of its own."""
    plain = "".join(c if c.isprintable() else " " for c in text)
    return FORMULA.sub(r"\1\2'", plain)


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
    """When a test was run, and how that is known."""

    day: datetime.date  # The date.
    # Running number or clock time as the file name writes it behind the date, such as `"001"` or
    # `"14_16_08"`; empty if there is none.
    number: str
    basis: str  # `"clock of the record"`, `"header of the file"` or `FILE_NAME`.


def date_of_test(path: Path, record: Record) -> DateOfTest | None:
    """Return the date of a test: that of its record, else the one in the name of its file.

    The time at which a file was last changed says when it was copied, and nothing of the test. Of
    two files joined by `+` the first counts.
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
    is writing has its name too; the same one, made of the same files, is replaced by the later: the
    identity holds the digests of the files behind it. Nobody else may choose a name in the folder
    in the meantime.

    Raises:
        InputError: If a thousand reports of this day, or undated ones, are there already.
        OSError: If the folder cannot be read.
    """
    words = name_of_test(test)
    day = "" if when is None else f"{when.day:%Y_%m_%d}"
    running = "" if when is None else when.number
    begun = names_begun(folder, CARDS[kind].stem)
    if words or running:
        ends = ("", *(f"-{number}" for number in range(2, MOST_REPORTS + 1)))
    else:  # the running numbers of a day
        ends = tuple(f"_{number:03d}" for number in range(1, MOST_REPORTS + 1))
    said = [words, day, running] if words or day else [UNDATED]
    for end in ends:
        name = "_".join([CARDS[kind].stem, *filter(None, said)]) + end
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
