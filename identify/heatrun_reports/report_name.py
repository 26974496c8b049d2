"""What a report is called: the test type, name and date of the test, and its running number."""

from __future__ import annotations

import datetime
import hashlib
import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from heatrun.errors import InputError
from heatrun.io.whole_files import names_begun
from heatrun.readers.dates import CLOCK_OF_DAY as CLOCK
from heatrun.record.record import Record

from .bench_test_types import CARDS, Kind

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
