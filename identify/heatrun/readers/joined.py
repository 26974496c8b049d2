"""A test as the command line names it: one file, or two loggers' files joined by their clocks.

A gap of the logger is bridged where its load is known or stated, else the record is two parts.
Within a bridged gap no reading is compared; the network runs through it on the load that was held,
or on none. Each of two parts has start temperatures of its own.
"""

import itertools
import re
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple, get_args

import numpy as np

from ..checks.time_axis import GAP_STEPS, MAX_GAP_S
from ..errors import InputError
from ..io.own_files import refuse_own_file
from ..io.toml_text import table_header
from ..record.by_resistance import with_winding
from ..record.channels import CHANNEL, OF_LOAD, READINGS
from ..record.derive import derive
from ..record.motor import GapLoad, Motor, PartsOfTest
from ..record.record import Finding, Record
from ..record.samples import place
from ..record.stretch import (
    Stretch,
    bridge,
    cut,
    mask,
    move_load,
    runs,
    stretch_of,
    windows_in,
    with_seen_start,
)
from .align import join
from .read import read_record

RATE = re.compile(r"^(?P<path>.*)@(?P<rate>[^@/\\]*)Hz$", re.DOTALL)
SHEET = re.compile(r"^(?P<path>.+\.xls[xm](?:\.gz)?)#(?P<sheet>.+)$", re.DOTALL | re.IGNORECASE)
NUMBER = re.compile(r"[0-9]+(\.[0-9]*)?|\.[0-9]+")


def read_tests(path: Path | str, motor: Motor, *, at_gaps: bool = True) -> tuple[Record, ...]:
    """Read a test, in as many records as `[tests.NAME]` of the motor file has stretches of it.

    One for each of several is named `NAME_1`, `NAME_2` and so on. Arguments as `read_test` and
    `parts_of`.

    Raises:
        InputError: As `read_test`.
    """
    text, stretch = _with_stretch(str(path))
    return parts_of(read_whole_test(text, motor), motor, stretch, at_gaps=at_gaps)


def parts_of(
    record: Record, motor: Motor, stretch: Stretch | None = None, *, at_gaps: bool = False
) -> tuple[Record, ...]:
    """Return the parts of a record that count, their gaps bridged where the load is known.

    They are those that `[tests.NAME]` use, or the stretch that is asked for in their place. At gaps
    of unknown load a record is parted too, if that is wanted.

    Raises:
        InputError: If a part or a mask holds no sample, or a mask covers the first one.
    """
    parts = motor.tests.get(record.name, PartsOfTest())
    said_by = f"[tests.{record.name}] of the motor file"
    windows = parts.mask
    mask(record, windows, f"mask in {said_by}")  # a window without a sample is an error
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
    record, is_joined = _read_files(str(path), motor)
    offset_s = motor.tests.get(record.name, PartsOfTest()).load_offset_s
    if offset_s and not is_joined:
        said_by = f"load_offset in [tests.{record.name}] of the motor file"
        record = move_load(record, offset_s, said_by)
    channels, notes = derive(
        record.channels, phases=motor.phases, losses=motor.losses, constants=motor.constants
    )
    return with_winding(replace(record, channels=channels, notes=(*record.notes, *notes)), motor)


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
    name, of = (sheet["path"], sheet["sheet"]) if sheet else (name, None)
    return _File(Path(name), of, rate)


def files_of(path: Path | str) -> tuple[tuple[Path, str | None], ...]:
    """Return the files of a test as the command line names it, each with the sheet it names."""
    return tuple((file.path, file.sheet) for file in _files(path))


def has_rate(path: Path | str) -> bool:
    """Return whether a file of a test carries its sampling rate behind it."""
    return any(file.rate is not None for file in _files(path))


def _with_stretch(text: str) -> tuple[str, Stretch | None]:
    return (text, None) if _exists(text) else stretch_of(text)


def _read_files(text: str, motor: Motor) -> tuple[Record, bool]:
    """Return a test, and whether it is of two files, whose loads stand where they belong."""
    if _exists(text) or "+" not in text:
        return _read(text, motor), False
    first, _, second = text.partition("+")
    if "+" in second:
        raise InputError(
            "expected at most two files joined by '+'.", where=text,
            remedy="Join the temperatures with one drive log.",
        )  # fmt: skip
    temperatures = _read(first, motor, is_part=True)
    offset_s = motor.tests.get(temperatures.name, PartsOfTest()).load_offset_s
    record, alignment = join(temperatures, _read(second, motor, is_part=True), offset_s=offset_s)
    low, high = alignment.interval_95_s
    note = (
        f"the drive's clock starts {alignment.offset_s:.2f} s after the thermometer's "
        f"(95 % {low:.2f} … {high:.2f} s, {alignment.method})"
    )
    return replace(record, notes=(*record.notes, note)), True


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


LEVEL_S = 60.0
"""Load and trend of the winding on either side are taken over this time [s]."""

SAME_LEVEL = 0.1
"""Loads within this share of the largest are one [1], as levels of load are in the checks."""

SAME_K = 2.0
"""Within this the winding after a gap is where a held load brings it [K]."""


def over_gaps(record: Record, load: GapLoad | None, *, splits: bool) -> tuple[Record, ...]:
    """Return a record with its gaps bridged, or its parts, without a name of their own yet.

    The load in them is what `[tests.NAME.gap]` says. None: a gap up to `MAX_GAP_S` stays as it is;
    in a longer one the load was held if it is the same on both sides and the winding has gone on as
    it would under it, else it is not known. A gap of unknown load splits the record if that is
    wanted; if not, it stays as it is.
    """
    record = _without_empty(record)
    time_s = record.time_s
    steps = np.diff(time_s)
    if time_s.size < 3 or not np.all(steps > 0.0):  # NaN is no number above 0 either
        return (record,)
    usual = float(np.median(steps))
    shortest = GAP_STEPS * usual if load else max(GAP_STEPS * usual, MAX_GAP_S)
    ends, bridged = [], []
    for at in map(int, np.flatnonzero(steps > shortest)):
        how = load or ("held" if _goes_on(record, at) else "unknown")
        if how != "unknown":
            bridged.append((at, how))
        elif splits:
            ends.append(at)
    is_stated = load is not None
    whole = _bridged(record, bridged, usual, is_stated)
    if not ends:
        return (whole,)
    found = []
    for before, end in itertools.pairwise((-1, *ends, time_s.size - 1)):
        stretch = Stretch(float(time_s[before + 1]), float(time_s[end]))
        part = cut(whole, stretch, "split at a gap")
        split = (_gap(record, before, "unknown", is_stated),) if found else ()
        found.append(replace(part, findings=(*part.findings, *split)))
    return tuple(found)


def _without_empty(record: Record) -> Record:
    """Return a record without the stretches in which it holds a time and no value: they are gaps.

    Parts that are named by rows keep theirs.
    """
    read = {one.channel for one in record.mapping} - {"time_s"}
    values = [record[name] for name in read if name in record]
    if record.first_row or not values:
        return record
    is_kept = np.any(np.isfinite(values), axis=0)
    for first, past in zip(*runs(~is_kept), strict=True):
        is_kept[first:past] |= past - first < GAP_STEPS
    channels = {name: column[is_kept] for name, column in record.channels.items()}
    return replace(record, channels=channels)


def _goes_on(record: Record, at: int) -> bool:
    """Return whether the load is one on both sides of a gap, and the winding shows no other."""
    time_s = record.time_s
    before = (time_s >= time_s[at] - LEVEL_S) & (time_s <= time_s[at])
    after = (time_s >= time_s[at + 1]) & (time_s <= time_s[at + 1] + LEVEL_S)
    for name in ("phase_current_A", "losses_W", "speed_rpm"):
        if name in record:
            values = record[name]
            largest = float(np.nanmax(np.abs(values), initial=0.0))
            sides = [values[side & np.isfinite(values)] for side in (before, after)]
            if not all(side.size for side in sides):
                return False
            if abs(float(np.mean(sides[0]) - np.mean(sides[1]))) > SAME_LEVEL * largest:
                return False
    if "winding_degC" not in record:
        return False
    winding = record["winding_degC"]
    trend = before & np.isfinite(winding)
    if np.sum(trend) < 2 or not np.isfinite(winding[at + 1]):
        return False
    slope, level = np.polyfit(time_s[trend] - time_s[at], winding[trend], 1)
    further = sorted((level, level + slope * (time_s[at + 1] - time_s[at])))
    return bool(further[0] - SAME_K <= winding[at + 1] <= further[1] + SAME_K)


def _bridged(
    record: Record, gaps: list[tuple[int, str]], usual_s: float, is_stated: bool
) -> Record:
    """Return a record with two samples at the ends of each gap that hold its load."""
    if not gaps:
        return record
    time_s = record.time_s
    at = np.repeat([place + 1 for place, _ in gaps], 2)
    ends = ((time_s[k] + usual_s, time_s[k + 1] - usual_s) for k, _ in gaps)
    knots = [float(end) for pair in ends for end in pair]
    channels = {}
    for name, values in record.channels.items():
        if name == "time_s":
            added = np.asarray(knots)
        elif name in READINGS:
            added = np.full(at.size, np.nan)
        elif name in CHANNEL and CHANNEL[name].quantity in OF_LOAD:
            level = [0.0 if how == "zero" else _level(time_s, values, place) for place, how in gaps]
            added = np.repeat(level, 2)
        else:
            added = np.interp(knots, time_s, values)
        channels[name] = np.insert(values, at, added)
    windows = tuple(zip(knots[::2], knots[1::2], strict=True))
    findings = [_gap(record, place, how, is_stated) for place, how in gaps]
    return replace(
        record,
        channels=channels,
        masks=(*record.masks, *windows),
        findings=(*record.findings, *findings),
    )


def _level(time_s: np.ndarray, values: np.ndarray, place: int) -> float:
    """Return the mean over the last minute before a gap."""
    last = (time_s >= time_s[place] - LEVEL_S) & (time_s <= time_s[place]) & np.isfinite(values)
    return float(np.mean(values[last])) if last.any() else float("nan")


def _gap(record: Record, at: int, how: str, is_stated: bool) -> Finding:
    """Return what is said of a gap, by its load and whether the motor file states that."""
    held, zero, unknown = (
        f'{table_header("tests", record.name, "gap")} load = "{load}"' for load in get_args(GapLoad)
    )
    if how == "unknown":
        words = (
            "The load in it is not known. Before and after are calibrated together, each from "
            "start temperatures of its own; the stator's has a wide prior after the gap"
        )
        remedy = f"If the load was held: {held}. If it was off: {zero}. "
        remedy += "The network then runs through the gap."
    elif is_stated:
        words = "held through it" if how == "held" else "zero in it"
        words, remedy = f"The load is {words}, as the motor file says", ""
    else:
        words = (
            "The load is the same on both sides, and the winding goes on as under it: it is held "
            "through the gap"
        )
        remedy = f"If the load was off in the gap: {zero}. If nobody knows: {unknown}."
    remedy = "" if is_stated else remedy
    from_s, to_s = (float(record.time_s[k]) for k in (at, at + 1))
    return Finding(
        "time_gap",
        "warning" if remedy else "note",
        f"The logger stood still for {to_s - from_s:.0f} s. {words}. No reading is compared there.",
        place(record, "time_s", from_s, to_s),
        remedy,
        values={"longest_s": to_s - from_s, "from_s": from_s, "to_s": to_s},
    )
