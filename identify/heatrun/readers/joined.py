"""A test as the command line names it: one file, or two loggers' files joined by their clocks."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from ..errors import InputError
from ..io.own_files import refuse_own_file
from ..record.by_resistance import with_winding
from ..record.derive import derive
from ..record.motor import Motor, PartsOfTest
from ..record.record import Record
from ..record.stretch import Stretch, bridge, cut, mask, stretch_of, windows_in, with_seen_start
from .align import join
from .gaps import over_gaps
from .read import read_record

RATE = re.compile(r"^(?P<path>.*)@(?P<rate>[^@/\\]*)Hz$", re.DOTALL)
SHEET = re.compile(r"^(?P<path>.+\.xls[xm](?:\.gz)?)#(?P<sheet>.+)$", re.DOTALL | re.IGNORECASE)
NUMBER = re.compile(r"[0-9]+(\.[0-9]*)?|\.[0-9]+")


def read_tests(path: Path | str, motor: Motor, *, at_gaps: bool = True) -> tuple[Record, ...]:
    """Read a test, in as many records as `[tests.NAME]` of the motor file has stretches of it.

    Args:
        path: As `read_test`.
        motor: The machine.
        at_gaps: As `parts_of`.

    Returns:
        One record; or one for each of several stretches, named `NAME_1`, `NAME_2` and so on.

    Raises:
        InputError: As `read_test`.
    """
    text, stretch = _with_stretch(str(path))
    return parts_of(read_whole_test(text, motor), motor, stretch, at_gaps=at_gaps)


def parts_of(
    record: Record, motor: Motor, stretch: Stretch | None = None, *, at_gaps: bool = False
) -> tuple[Record, ...]:
    """Return the parts of a record that count, their gaps bridged where the load is known.

    Args:
        record: The whole.
        motor: Its `[tests.NAME]` say which parts are used, and what is masked.
        stretch: The part that is asked for in place of those.
        at_gaps: Whether a gap of unknown load parts a record too.

    Raises:
        InputError: If a part or a mask holds no sample, or a mask covers the first one.
    """
    parts = motor.tests.get(record.name, PartsOfTest())
    said_by = f"[tests.{record.name}] of the motor file"
    windows = parts.mask
    mask(record, windows, f"mask in {said_by}")  # a window without a sample is an error
    if parts is not None:
        record = bridge(record, parts.bridge, f"bridge in {said_by}")
    if stretch is not None:
        found = [cut(record, stretch, "asked for with the file")]
    else:
        found = [cut(record, one, f"use in {said_by}") for one in parts.use] or [record]
    found = [part for one in found for part in over_gaps(one, parts.gap_load, splits=at_gaps)]
    found = [mask(one, windows_in(one, windows), f"mask in {said_by}") for one in found]
    if len(found) > 1:
        found = [
            replace(one, name=f"{one.name}_{n}", part_of=record.name)
            for n, one in enumerate(found, start=1)
        ]
    return tuple(with_seen_start(one, windows) for one in found)


def read_test(path: Path | str, motor: Motor) -> Record:
    """Read a test, from one file or from two.

    Args:
        path: A file; or `TEMPERATURES+DRIVE`, two files of loggers that were not started
            together, whose offset is then estimated. A file without a time column carries its
            sampling rate behind it, as in `drive.csv@10Hz`; a sheet of a workbook is named as in
            `tests.xlsx#Cold start`, a stretch as in `drive.csv@10min..90min`.
        motor: The machine; its `[tests.NAME]` say which part of the record is used.

    Returns:
        The record; the offset and its doubt stand in its notes and findings.

    Raises:
        InputError: If a file cannot be read, the two cannot be joined, a stretch is empty, or the
            motor file uses several stretches and none of them is named.
    """
    first, *others = read_tests(path, motor, at_gaps=False)
    if others:
        raise InputError(
            f"The motor file uses {1 + len(others)} stretches of this test: "
            f"{', '.join(record.stretch for record in (first, *others))}.",
            where=str(path),
            remedy=f"Name the one that is meant, such as {path}@{first.stretch}.",
        )
    return first


def read_whole_test(path: Path | str, motor: Motor) -> Record:
    """Read a test as `read_test` without a stretch, whatever parts of it the motor file uses.

    Raises:
        InputError: If a file cannot be read or the two cannot be joined.
    """
    return _with_constants(_read_files(str(path), motor), motor)


class _File(NamedTuple):
    """A file as the command line names it."""

    path: Path
    sheet: str | None
    rate: str | None


def _files(path: Path | str) -> list[_File]:
    text, _ = _with_stretch(str(path))
    return [_file(part) for part in ((text,) if _exists(text) else text.split("+"))]


def _file(text: str) -> _File:
    found = None if _exists(text) else RATE.match(text)
    name, rate = (found["path"], found["rate"].strip()) if found else (text, None)
    sheet = None if _exists(name) else SHEET.match(name)
    if sheet is None:
        return _File(Path(name), None, rate)
    return _File(Path(sheet["path"]), sheet["sheet"], rate)


def files_of(path: Path | str) -> tuple[tuple[Path, str | None], ...]:
    """Return the files of a test as the command line names it, each with the sheet it names."""
    return tuple((file.path, file.sheet) for file in _files(path))


def has_rate(path: Path | str) -> bool:
    """Return whether a file of a test carries its sampling rate behind it."""
    return any(file.rate is not None for file in _files(path))


def _with_stretch(text: str) -> tuple[str, Stretch | None]:
    return (text, None) if _exists(text) else stretch_of(text)


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
    """Return the record with the constants of the motor file, and what follows with them."""
    channels, notes = derive(
        record.channels, phases=motor.phases, losses=motor.losses, constants=motor.constants
    )
    held = replace(record, channels=channels, notes=(*record.notes, *notes))
    return with_winding(held, motor)


def _read(text: str, motor: Motor, *, is_part: bool = False) -> Record:
    path, sheet, rate = _file(text)
    if rate is not None and (path == Path() or not NUMBER.fullmatch(rate)):
        raise InputError(
            f"Expected a file and its sampling rate, as in drive.csv@10Hz, got '{text[:80]}'.",
            where=text,
            remedy="Write the rate as a number with a point, such as 10 or 0.5.",
        )
    refuse_own_file(path, for_fit=False)
    rate_Hz = None if rate is None else float(rate)
    return read_record(path, motor, rate_Hz=rate_Hz, is_part=is_part, sheet=sheet)


def _exists(text: str) -> bool:
    """Return whether there is such a file; a name that no file can have is none."""
    try:
        return Path(text).exists()
    except (OSError, ValueError):
        return False
