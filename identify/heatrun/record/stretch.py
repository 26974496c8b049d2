"""Parts of a record: stretches that are used, and readings that are left out of the comparison.

A stretch is written `600s..5400s`, `10min..1.5h`, `..90min` or `row 1..row 5000`, behind the file
as in `drive.csv@10min..90min`. Times are those of the record, counted from its first sample; a
stretch keeps them, so that a finding and a figure name the same moment with and without the cut.
"""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from .channels import CHANNEL, READINGS
from .record import Record

SECONDS = {"s": 1.0, "min": 60.0, "h": 3600.0}

TIME = re.compile(r"(?P<number>[0-9]+(\.[0-9]*)?|\.[0-9]+)\s*(?P<unit>s|min|h)?")
ROW = re.compile(r"row\s*(?P<row>[0-9]{1,15})")
SUFFIX = re.compile(r"(?P<test>.+)@(?P<stretch>[^@/\\+]*?\.\.[^@/\\+]*)", re.DOTALL)


@dataclass(frozen=True)
class Stretch:
    """A part of a record."""

    start: float = 0.0  # Its first time [s], or its first row, counted from 1.
    end: float = math.inf  # Its last time [s], or its last row.
    in_rows: bool = False  # Whether rows are meant.

    def __str__(self) -> str:
        """Return it as it is written behind a file."""
        word, unit = ("row ", "") if self.in_rows else ("", "s")
        last = "" if math.isinf(self.end) else f"{word}{self.end:.12g}{unit}"
        return f"{word}{self.start:.12g}{unit}..{last}"


def split_stretch(text: str) -> tuple[str, str]:
    """Return a test as the command line names it, and the stretch behind it, empty where none is.

    `drive.csv@10min..90min` gives `drive.csv` and `10min..90min`.
    """
    found = SUFFIX.fullmatch(text)
    return (text, "") if found is None else (found["test"], found["stretch"])


def stretch_of(text: str) -> tuple[str, Stretch | None]:
    """Return a test as the command line names it, without its stretch, and the stretch, if any.

    Raises:
        InputError: If what stands behind `@` is no stretch.
    """
    test, stretch = split_stretch(text)
    if not stretch:
        return text, None
    start, _, end = stretch.partition("..")
    return test, parse_stretch(start, end, text)


def parse_stretch(start: str, end: str, where: str) -> Stretch:
    """Return the stretch between two texts such as `10 min` and `1.5 h`; empty is open.

    Raises:
        InputError: If one of them is neither, or the end is not behind the start.
    """
    rows = [ROW.fullmatch(part.strip()) for part in (start, end)]
    if any(rows):
        first = _row(rows[0], start, 1.0, where)
        last = _row(rows[1], end, math.inf, where)
        return in_order(Stretch(first, last, in_rows=True), where)
    first = parse_time(start, where) if start.strip() else 0.0
    last = parse_time(end, where) if end.strip() else math.inf
    return in_order(Stretch(first, last), where)


def parse_time(
    text: str,
    where: str,
    remedy: str = "Write a stretch as FILE@10min..90min, rows as FILE@row 1..row 5000.",
) -> float:
    """Return a time such as `600s`, `10 min` or `1.5h` in seconds.

    Raises:
        InputError: If it is none.
    """
    found = TIME.fullmatch(text.strip())
    if found is None:
        raise InputError(
            f"Expected a time such as 600s, 10min or 1.5h, got '{text.strip()[:80]}'.",
            where=where,
            remedy=remedy,
        )
    return float(found["number"]) * SECONDS[found["unit"] or "s"]


def in_order(stretch: Stretch, where: str) -> Stretch:
    """Return a stretch that ends after it begins.

    Raises:
        InputError: If it does not.
    """
    if stretch.end <= stretch.start:
        raise InputError(
            f"The stretch {stretch} ends before it begins.",
            where=where,
            remedy="Write the earlier end first.",
        )
    return stretch


def cut(record: Record, stretch: Stretch, said_by: str) -> Record:
    """Return the part of a record, with its times as they are.

    Raises:
        InputError: If the record has no sample there.
    """
    place = np.arange(1, record.time_s.size + 1) if stretch.in_rows else record.time_s
    kept = (place >= stretch.start) & (place <= stretch.end)
    if not kept.any():
        span = f"{np.nanmin(place):.6g} s to {np.nanmax(place):.6g} s"
        span = f"rows 1 to {place.size}" if stretch.in_rows else span
        raise InputError(
            f"The stretch {stretch} holds no sample; the record has {span}.",
            where=f"{record.name}, {said_by}",
            remedy="Times are counted from the first sample of the file.",
        )
    first_row = int(stretch.start) if stretch.in_rows else 0
    if not stretch.in_rows and np.any(np.diff(record.time_s[kept]) < 0.0):
        rows = np.flatnonzero(kept)  # a time that comes twice names no part: all between counts
        kept[rows[0] : rows[-1] + 1] = True
        first_row = int(rows[0]) + 1
    channels = {name: values[kept] for name, values in record.channels.items()}
    note = f"of {kept.size} samples the {int(kept.sum())} of {stretch} are used: {said_by}"
    return record.having(channels, note, stretch=str(stretch), first_row=first_row)


def mask(record: Record, windows: Sequence[tuple[float, float]], said_by: str) -> Record:
    """Return a record whose readings of winding and bodies are left out in some windows [s].

    Current, losses and sink stay: the model is simulated through, and not compared.

    Raises:
        InputError: If a window holds no sample.
    """
    if not windows:
        return record
    time_s = record.time_s
    for low, high in windows:
        if not windows_in(record, [(low, high)]):
            raise InputError(
                f"The window {low:g} s to {high:g} s holds no sample; the record has "
                f"{np.nanmin(time_s):.6g} s to {np.nanmax(time_s):.6g} s.",
                where=f"{record.name}, {said_by}",
                remedy="Times are counted from the first sample of the file.",
            )
    masks = (*record.masks, *windows)
    hidden = within(time_s, masks)
    channels = {
        name: np.where(hidden, np.nan, values) if name in READINGS else values
        for name, values in record.channels.items()
    }
    note = f"readings from {_spans(windows)} are not compared: {said_by}"
    return record.having(channels, note, masks=masks)


def bridge(record: Record, windows: Sequence[tuple[float, float]], said_by: str) -> Record:
    """Return a record whose loads run straight through some windows [s].

    Temperatures stay. Each other channel is interpolated between the samples on either side: for
    values that a logger made up, such as 65535.

    Raises:
        InputError: If a window holds no sample, or all of them.
    """
    if not windows:
        return record
    hidden = within(record.time_s, windows)
    if hidden.all() or not all(windows_in(record, [window]) for window in windows):
        raise InputError(
            "A window of bridge holds no sample, or every one.",
            where=f"{record.name}, {said_by}",
            remedy="Times are counted from the first sample of the file.",
        )
    seen = ~hidden & np.isfinite(record.time_s)
    channels = {}
    for name, values in record.channels.items():
        if _is_load(name):
            known = seen & np.isfinite(values)
            if known.any():
                straight = np.interp(record.time_s, record.time_s[known], values[known])
                channels[name] = np.where(hidden, straight, values)
    return record.having(channels, f"loads from {_spans(windows)} are interpolated: {said_by}")


def _spans(windows: Sequence[tuple[float, float]]) -> str:
    return ", ".join(f"{low:g} s to {high:g} s" for low, high in windows)


def move_load(record: Record, offset_s: float, said_by: str) -> Record:
    """Return a record whose load is so many seconds later, over the time that both cover.

    Raises:
        InputError: If no time has load and temperatures.
    """
    if not offset_s:
        return record
    at = record.time_s - offset_s
    known = np.isfinite(record.time_s)
    kept = known & (at >= record.time_s[known][0]) & (at <= record.time_s[known][-1])
    if not kept.any():
        raise InputError(
            f"Moved by {offset_s:g} s, the load has no time in common with the temperatures; the "
            f"record lasts {record.duration_s:.6g} s.",
            where=f"{record.name}, {said_by}",
            remedy="Write the offset in seconds.",
        )
    channels = {
        name: np.interp(at[kept], record.time_s[known], values[known])
        if _is_load(name)
        else values[kept]
        for name, values in record.channels.items()
    }
    return record.having(channels, f"the load is moved by {offset_s:+g} s: {said_by}")


def _is_load(channel: str) -> bool:
    return channel in CHANNEL and CHANNEL[channel].quantity not in ("temperature", "time")


def windows_in(
    record: Record, windows: Sequence[tuple[float, float]]
) -> tuple[tuple[float, float], ...]:
    """Return those windows, first and last time [s], that hold a sample of a record."""
    time_s = record.time_s
    return tuple((low, high) for low, high in windows if np.any((time_s >= low) & (time_s <= high)))


def masked(record: Record) -> np.ndarray:
    """Return which samples of a record lie in one of its masks, shape (time,)."""
    return within(record.time_s, record.masks)


def within(time_s: np.ndarray, windows: Sequence[tuple[float, float]]) -> np.ndarray:
    """Return which times [s] lie in one of some windows, first and last time [s], shape (time,)."""
    inside = np.zeros(time_s.size, dtype=bool)
    for low, high in windows:
        inside |= (time_s >= low) & (time_s <= high)
    return inside


def with_seen_start(record: Record, windows: Sequence[tuple[float, float]]) -> Record:
    """Return a record whose first reading no window [s] covers: the temperatures start from it.

    Raises:
        InputError: If one does.
    """
    if any(low <= record.time_s[0] <= high for low, high in windows):
        raise InputError(
            "The mask covers the first sample, from which the temperatures start.",
            where=f"{record.name}, [tests.NAME] mask of the motor file",
            remedy="Leave the begin out by use, such as use = [[600, 9000]].",
        )
    return record


def _row(found: re.Match[str] | None, text: str, otherwise: float, where: str) -> float:
    if not text.strip():
        return otherwise
    if found is None:
        raise InputError(
            f"Expected a row such as 'row 5000', got '{text.strip()[:80]}'.",
            where=where,
            remedy="Write both ends as rows, or both as times.",
        )
    return float(found["row"])


def runs(mask: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return first index and one past the last of each stretch where the mask is true."""
    edges = np.diff(np.concatenate(([False], mask, [False])).astype(np.int8))
    return np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)


def windows(time_s: np.ndarray, mask: np.ndarray) -> list[tuple[float, float]]:
    """Return first and last time of each stretch where the mask is true [s]."""
    first, past = runs(mask)
    return [(float(time_s[a]), float(time_s[b - 1])) for a, b in zip(first, past, strict=True)]
