"""What a report is called: the test type, the date of the test, and its running number."""

from __future__ import annotations

import datetime
import hashlib
import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from ...bench import Record
from ...bench.clocks.day import CLOCK
from ...errors import InputError
from ...io.file_set import names_begun
from .card import CARDS, Kind

IN_NAME = re.compile(
    r"(?<!\d)(?P<year>20\d\d)[_\-.]?(?P<month>0[1-9]|1[0-2])[_\-.]?(?P<day>0[1-9]|[12]\d|3[01])"
    r"(?P<rest>(?:[_\-.]\d{1,6})*)(?!\d)"
)
FILE_NAME = "file name"

UNDATED = "undated"
"""Stands in the name of a report where neither record nor file name gives the date of the test."""

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


def choose_name(folder: Path, kind: Kind, when: DateOfTest | None, identity: list[str]) -> str:
    """Return the name of the report of a test, without its ending: its former one, or a free one.

    A PDF without a JSON of heatrun's beside it is someone else's. A report that another process
    is writing has its name too; the same one, made of the same files, is replaced by the later.

    Args:
        folder: Of the reports; nobody else may choose a name in it in the meantime.
        kind: Test type.
        when: Date and number of the test; None where the date is not known.
        identity: Digests of the files behind the report; one with the same is overwritten.

    Raises:
        InputError: If a thousand reports of this day, or undated ones, are there already.
        OSError: If the folder cannot be read.
    """
    day = UNDATED if when is None else f"{when.day:%Y_%m_%d}"
    begun = names_begun(folder, CARDS[kind].stem)
    for number in _numbers("" if when is None else when.number):
        name = f"{CARDS[kind].stem}_{day}_{number}"
        others = {n for n in begun if n.partition(".")[0] == name} - {set_name(name, identity)}
        taken = [folder / f"{name}{end}" for end in (".pdf", ".csv", ".json")]
        if others or (any(path.exists() for path in taken) and _identity(taken[-1]) != identity):
            continue
        return name
    raise InputError(
        f"{MOST_REPORTS} reports of this test type and day are there already.",
        where=str(folder),
        remedy="Choose another folder with --out.",
    )


def _numbers(given: str) -> Iterator[str]:
    """Give the running numbers of a day; behind a number of the test's own, those of `-2`, `-3`."""
    if not given:
        yield from (f"{number:03d}" for number in range(1, MOST_REPORTS + 1))
        return
    yield given
    yield from (f"{given}-{number}" for number in range(2, MOST_REPORTS + 1))


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
