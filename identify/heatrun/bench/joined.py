"""A test as the command line names it: one file, or two loggers' files joined by their clocks."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..motor import Motor
from .clocks.align import join
from .readers.read import read_record
from .record import Record

RATE = re.compile(r"^(?P<path>.*)@(?P<rate>[^@/\\]*)Hz$", re.DOTALL)
SHEET = re.compile(r"^(?P<path>.+\.xls[xm](?:\.gz)?)#(?P<sheet>.+)$", re.DOTALL | re.IGNORECASE)
NUMBER = re.compile(r"[0-9]+(\.[0-9]*)?|\.[0-9]+")


def read_test(path: Path | str, motor: Motor) -> Record:
    """Read a test, from one file or from two.

    Args:
        path: A file; or `TEMPERATURES+DRIVE`, two files of loggers that were not started
            together, whose offset is then estimated. A file without a time column carries its
            sampling rate behind it, as in `drive.csv@10Hz`; a sheet of a workbook is named as in
            `tests.xlsx#Cold start`.
        motor: The machine.

    Returns:
        The record; the offset and its doubt stand in its notes and findings.

    Raises:
        InputError: If a file cannot be read or the two cannot be joined.
    """
    return _with_constants(_read_files(str(path), motor), motor)


def files_of(path: Path | str) -> tuple[tuple[Path, str | None], ...]:
    """Return the files of a test as the command line names it, each with its sheet if it names one.

    Args:
        path: As `read_test`.
    """
    text = str(path)
    files = []
    for part in (text,) if _exists(text) else text.split("+"):
        rate = None if _exists(part) else RATE.match(part)
        files.append(_with_sheet(rate["path"] if rate else part))
    return tuple(files)


def _with_sheet(text: str) -> tuple[Path, str | None]:
    found = None if _exists(text) else SHEET.match(text)
    return (Path(text), None) if found is None else (Path(found["path"]), found["sheet"])


def _read_files(text: str, motor: Motor) -> Record:
    if _exists(text) or "+" not in text:
        return _read(text, motor)
    first, _, second = text.partition("+")
    if "+" in second:
        raise InputError(
            "expected at most two files joined by '+'.", where=text,
            remedy="Join the temperatures with one drive log.",
        )  # fmt: skip
    record, alignment = join(_read(first, motor, is_part=True), _read(second, motor, is_part=True))
    low, high = alignment.interval_95_s
    note = (
        f"the drive's clock starts {alignment.offset_s:.2f} s after the thermometer's "
        f"(95 % {low:.2f} … {high:.2f} s, {alignment.method})"
    )
    return replace(record, notes=(*record.notes, note))


def _with_constants(record: Record, motor: Motor) -> Record:
    """Return the record with the constants of the motor file for channels that it does not have."""
    added = {name: value for name, value in motor.constants.items() if name not in record}
    if not added:
        return record
    size = record.time_s.size
    channels = {name: np.full(size, value) for name, value in added.items()}
    notes = [f"{name} = {value:g} throughout: [constants] of the motor file"
             for name, value in added.items()]  # fmt: skip
    return replace(record, channels={**record.channels, **channels}, notes=(*record.notes, *notes))


def _read(text: str, motor: Motor, *, is_part: bool = False) -> Record:
    found = None if _exists(text) else RATE.match(text)
    if found is None:
        path, sheet = _with_sheet(text)
        return read_record(path, motor, is_part=is_part, sheet=sheet)
    rate = found["rate"].strip()
    if not found["path"] or not NUMBER.fullmatch(rate):
        raise InputError(
            f"Expected a file and its sampling rate, as in drive.csv@10Hz, got '{text[:80]}'.",
            where=text,
            remedy="Write the rate as a number with a point, such as 10 or 0.5.",
        )
    path, sheet = _with_sheet(found["path"])
    return read_record(path, motor, rate_Hz=float(rate), is_part=is_part, sheet=sheet)


def _exists(text: str) -> bool:
    """Return whether there is such a file; a name that no file can have is none."""
    try:
        return Path(text).exists()
    except (OSError, ValueError):
        return False
