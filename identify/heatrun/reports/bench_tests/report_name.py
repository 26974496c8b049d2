"""What a report is called: the test type, the date of the test, and its running number."""

from __future__ import annotations

import datetime
import hashlib
import json
import re
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from ...errors import InputError
from ...io.file_set import names_begun
from ...io.moment import moment
from .card import CARDS, Kind

IN_NAME = re.compile(
    r"(?<!\d)(?P<year>20\d\d)[_\-.]?(?P<month>0[1-9]|1[0-2])[_\-.]?(?P<day>0[1-9]|[12]\d|3[01])"
    r"(?P<rest>(?:[_\-.]\d{1,6})*)(?!\d)"
)
IN_HEADER = re.compile(
    r"(?<!\d)(?:(?P<iso>20\d\d-\d\d-\d\d)|(?P<first>\d{1,2})[/.](?P<second>\d{1,2})[/.]"
    r"(?P<year>20\d\d))(?!\d)"
)
HEADER_BYTES = 2048
"""Preambles of loggers are a few lines long."""

FILE_TIME = "time of the last change of the file"

MOST_REPORTS = 999


@dataclass(frozen=True)
class DateOfTest:
    """When a test was run, and how that is known.

    Attributes:
        day: The date.
        number: Running number or clock time as the file name writes it behind the date, such as
            `"001"` or `"14_16_08"`; empty if there is none.
        basis: `"clock of the record"`, `"file name"`, `"header of the file"`, or `FILE_TIME`, which
            gives the report a name and says nothing of the test.
    """

    day: datetime.date
    number: str
    basis: str

    @property
    def is_of_the_test(self) -> bool:
        """Whether the test was run on that day: a file that was copied has another."""
        return self.basis != FILE_TIME


def date_of_test(path: Path, start: str = "") -> DateOfTest:
    """Return the date of a test from the clock of its record, its file name or its header.

    Where none of them has one, the file's own time does for the name of the report.

    Args:
        path: The bench file; of two joined by `+`, the first.
        start: Day on which the record began by its own clock, ISO 8601; empty if it has none.

    Raises:
        InputError: If the file cannot be opened.
    """
    text = str(path)
    first = path if path.exists() else Path(text.partition("+")[0].partition("@")[0])
    for found in IN_NAME.finditer(first.name):
        day = _day(int(found["year"]), int(found["month"]), int(found["day"]))
        if day is not None:
            number = re.sub(r"[\-.]", "_", found["rest"].strip("_-."))
            if not start or start == day.isoformat():
                return DateOfTest(day, number, "clock of the record" if start else "file name")
    if start:
        return DateOfTest(datetime.date.fromisoformat(start), "", "clock of the record")
    try:
        day = _in_header(_head(first))
        if day is not None:
            return DateOfTest(day, "", "header of the file")
        changed = datetime.datetime.fromtimestamp(first.stat().st_mtime, tz=datetime.UTC)
    except OSError as error:
        raise InputError(
            f"The file cannot be opened ({error.strerror}).", where=text, remedy="Check the path."
        ) from error
    return DateOfTest(changed.date(), "", FILE_TIME)


def choose_name(folder: Path, kind: Kind, when: DateOfTest | None, identity: list[str]) -> str:
    """Return the name of the report of a test, without its ending: its former one, or a free one.

    A PDF without a JSON of heatrun's beside it is someone else's. A report that another process
    is writing has its name too; the same one, made of the same files, is replaced by the later.

    Args:
        folder: Of the reports; nobody else may choose a name in it in the meantime.
        kind: Test type.
        when: Date and number of the test; today's for a record in memory.
        identity: Digests of the files behind the report; one with the same is overwritten.

    Raises:
        InputError: If a thousand reports of this day are there already.
        OSError: If the folder cannot be read.
    """
    day = moment().date() if when is None else when.day
    begun = names_begun(folder, CARDS[kind].stem)
    for number in _numbers("" if when is None else when.number):
        name = f"{CARDS[kind].stem}_{day:%Y_%m_%d}_{number}"
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


def _head(path: Path) -> str:
    with path.open("rb") as file:
        data = file.read(HEADER_BYTES)
    if data.startswith(b"\x1f\x8b"):
        try:
            data = zlib.decompressobj(wbits=31).decompress(data, HEADER_BYTES)
        except zlib.error:
            return ""
    return data.decode("latin-1")


def _in_header(text: str) -> datetime.date | None:
    """The first date that can be read in one way only; 03/04 could be March or April."""
    for found in IN_HEADER.finditer(text):
        if found["iso"]:
            year, month, day = (int(part) for part in found["iso"].split("-"))
        else:
            day, month, year = int(found["first"]), int(found["second"]), int(found["year"])
            if month > 12:
                day, month = month, day
            elif day <= 12 and day != month and "." not in found[0]:
                continue
        if (date := _day(year, month, day)) is not None:
            return date
    return None


def _day(year: int, month: int, day: int) -> datetime.date | None:
    try:
        return datetime.date(year, month, day)
    except ValueError:
        return None
