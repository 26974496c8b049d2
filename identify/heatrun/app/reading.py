"""The chosen tests read and checked, for a thread beside the page."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

from ..bench.channels.column_mapping import HEAD, describe_columns, grouped
from ..bench.checks import check_record
from ..errors import InputError
from ..io.opening import Opener, opening_by
from ..motor import Motor
from ..motorfile import load_motor
from .store import Opened, RecordStore
from .words import error_message, findings_html, message, table


@dataclass(frozen=True)
class Reading:
    """What became of the chosen tests.

    Attributes:
        opened: Those that could be read.
        problems: Why the others could not, as HTML.
        checks: Findings and how the files were read, as HTML.
    """

    opened: tuple[Opened, ...]
    problems: str
    checks: str


def read_tests(
    names: Sequence[str],
    motor_name: str | None,
    path: Callable[[str], Path],
    store: RecordStore,
    opener: Opener,
) -> Reading:
    """Read tests; one that cannot be read is named, and the others are.

    Args:
        names: Tests as the page lists them.
        motor_name: The motor file as the page lists it, or None.
        path: Returns the file of a name, or raises InputError.
        store: Holds what was read before.
        opener: Opens files in the folders that are shown, and no others.
    """
    opened: list[Opened] = []
    problems: list[str] = []
    findings = []
    with opening_by(opener):
        try:
            motor = None if motor_name is None else load_motor(path(motor_name))
        except Exception as error:
            fault = message("warning", "The motor file is at fault.")
            return Reading((), problem(str(motor_name), error), fault)
        for name in names:
            try:
                test = store.open(path(name), motor)
                findings += check_record(test.record, motor) if motor else []
                opened.append(test)
            except Exception as error:
                problems.append(problem(name, error))
    return Reading(tuple(opened), "".join(problems), _checks(opened, motor, findings))


def problem(name: str, error: Exception) -> str:
    """Return what went wrong with a file as HTML; what is not the file's fault is printed too.

    Args:
        name: The file as the page lists it.
        error: What was raised.
    """
    if isinstance(error, InputError):
        return error_message(error)
    if isinstance(error, MemoryError):
        return message("error", f"{name}: there is not enough memory to read it.")
    traceback.print_exception(error)
    words = f"{name}: internal error ({error!r:.200}); the details are in the terminal."
    return message("error", words)


def _checks(opened: Sequence[Opened], motor: Motor | None, findings: Sequence) -> str:
    if not opened:
        return message("note", "Choose tests on the left.")
    if motor is None:
        return message("warning", "Choose a motor file: checks need it.") + _notes(opened)
    return findings_html(findings) + _notes(opened)


def _notes(opened: Sequence[Opened]) -> str:
    rows = [(each.record.name, note) for each in opened for note in each.record.notes]
    rows += [
        (each.record.name, f"Columns that are not used: {', '.join(each.record.unused)}")
        for each in opened
        if each.record.unused
    ]
    tests = [describe_columns(each.record) for each in opened]
    columns = "".join(
        f"<h3>Columns of {escape(names)}</h3>" + table(HEAD, lines)
        for names, lines in grouped(tests)
    )
    notes = "<h3>How the files were read</h3>" + table(("test", "note"), rows) if rows else ""
    return columns + notes
