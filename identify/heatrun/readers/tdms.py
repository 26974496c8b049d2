"""Reader of TDMS measurement files; needs the extra `heatrun[tdms]`.

Only the channels that are asked for are read. The index file that may lie beside a TDMS file is not
opened, since it may belong to another recording. Scalings and segments are checked before the
library builds or reads what is in them.

Layout of the lead-in: National Instruments, "TDMS File Format Internal Structure".
"""

import contextlib
import io
import re
import struct
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, BinaryIO

import numpy as np

from ..record.channels import CHANNEL, COLUMN_MAPS, Columns, lines_of
from ..record.header import split_name
from ..record.record import Finding, UnitSource
from ..record.table import Column, Stated
from ..record.units import require_unit, to_canonical
from .foreign import BrokenFileError, damaged, library, reading
from .labels import columns_of
from .mapping import unit_of
from .measurement import Measurement, Series, StoredChannel

SCALE_KINDS = ("Polynomial", "Linear", "RTD", "Strain", "Table", "Thermistor", "Thermocouple",
         "AdvancedAPI")  # fmt: skip
"""Scalings of one input that the library computes."""

SUMS = ("Add", "Subtract")
MOST_SUMS = 4
"""Each may double the work, since its two inputs are computed anew."""

MOST_SCALES = 32
"""A measuring card writes up to about five in a row."""

SCALE = re.compile(r"NI_Scale\[(\d+)\]_Scale_Type")


def scaling_refusal(properties: Sequence[Mapping[str, object]]) -> tuple[str, str] | None:
    """Return why the scaling of a channel cannot be trusted and what to do, None if it can.

    A scaling is numbers only: polynomials, tables, laws of sensors. Yet their count is a property
    of the file and allocated as it stands, sums refer to each other without limit, and of a kind
    that is not known the library returns the raw values without a word.

    Of the properties of channel, group and file the first with scalings count.
    """
    for held in properties:
        found = {int(match[1]): str(kind) for name, kind in held.items()
                 if (match := SCALE.match(name))}  # fmt: skip
        stated = held.get("NI_Number_Of_Scales", max(found, default=-1) + 1)
        if not isinstance(stated, int) or not 0 <= stated <= MOST_SCALES:
            return (
                f"The channel states {stated} scalings, expected 0 to {MOST_SCALES}.",
                "Copy the file again from the bench; it may be damaged.",
            )
        if stated == 0 or held.get("NI_Scaling_Status") == "scaled":
            continue
        unknown = [kind for kind in found.values() if kind not in (*SCALE_KINDS, *SUMS)]
        if unknown or sum(kind in SUMS for kind in found.values()) > MOST_SUMS:
            return (
                f"The scaling {', '.join(unknown or SUMS)} is not read.",
                "Export the channel with its physical values.",
            )
        return None
    return None


TAG = b"TDSm"
LEAD_IN = 28
"""Length of a lead-in [bytes]: tag, contents, version, length, length of the metadata."""

BIG_ENDIAN = 1 << 6
"""Bit of the contents: the numbers of the segment have the highest byte first."""

NOT_CLOSED = 2**64 - 1
"""Length of a segment that its writer did not finish."""


def check_segments(stream: BinaryIO, where: str) -> Iterator[Finding]:
    """Yield a finding if the recorder did not close the last of the segments of a file.

    Raises:
        BrokenFileError: If a segment begins with anything else, or ends beyond the file.
    """
    size = stream.seek(0, io.SEEK_END)
    position = 0
    while position < size:
        stream.seek(position)
        lead_in = stream.read(LEAD_IN)
        if len(lead_in) < LEAD_IN or not lead_in.startswith(TAG):
            raise BrokenFileError(f"no segment begins at byte {position} of {size}")
        contents = int.from_bytes(lead_in[4:8], "little")
        order = ">" if contents & BIG_ENDIAN else "<"
        length, metadata_length = struct.unpack(f"{order}QQ", lead_in[12:])
        if length == NOT_CLOSED:
            yield Finding(
                "recording_not_closed",
                "warning",
                f"The recorder did not close the file: the segment at byte {position} has no "
                "length, and is read as far as it goes.",
                where,
                "Check that the end of the test is there.",
                values={"from_byte": position},
            )
            return
        if metadata_length > length or position + LEAD_IN + length > size:
            raise BrokenFileError(
                f"a segment of {length} bytes at byte {position} ends beyond the {size} bytes of "
                "the file"
            )
        position += LEAD_IN + length


WHAT = "a TDMS file"
MICROSECOND = np.timedelta64(1, "us")
TIME_LABELS = (
    "time_s",
    *(label for one in COLUMN_MAPS for label, name in one.entries.items() if name == "time_s"),
)
"""Names of a channel of times, as in tables."""

KINDS = {"O": "text", "U": "text", "S": "text", "M": "dates", "c": "complex numbers"}
"""What a channel holds, by the kind of its type; others are raw bytes."""


LEAST_KNOWN: tuple[UnitSource, ...] = ("assumed", "name", "stated")


@dataclass(frozen=True)
class Clock:
    """Where the times of a group come from."""

    channel: Any = None  # The channel of times, None if each channel has a start and an increment.
    origin: np.datetime64 | None = None  # First date in it, None for plain numbers.
    unit: str | None = None  # Unit of plain numbers that `[columns]` gives, None if it gives none.


@contextlib.contextmanager
def open_tdms(
    stream: BinaryIO, where: str, columns: Columns | None = None
) -> Iterator[Measurement]:
    """Open a TDMS file; its channels can be read until the context ends.

    A channel has the times of its waveform properties, else those of a channel of times in its
    group, which `[columns]` may name, else none. Dates count from the earliest of the file.

    Raises:
        InputError: If npTDMS is not installed, or the file is damaged or cut.
    """
    nptdms = library("nptdms", "TDMS", where)
    with reading(WHAT, where):
        findings = tuple(check_segments(stream, where))
        stream.seek(0)
        file: Any = nptdms.TdmsFile.open(stream)
        _check_lengths(file, stream.seek(0, io.SEEK_END))
        claimed = dict(split_name(text) for name, text in lines_of(columns) if name == "time_s")
        clocks = {group.name: _clock(group, claimed) for group in file.groups()}
        origin = _origin(file, clocks)
        channels = tuple(
            _stored(channel, group, file)
            for group in file.groups()
            for channel in group.channels()
            if channel is not clocks[group.name].channel
        )
    used = [clock.channel.name for clock in clocks.values() if clock.channel is not None]
    plain = [clock for clock in clocks.values() if clock.channel is not None and not clock.origin]
    known_from = [_clock_unit(clock, where)[1] for clock in plain]
    least: list[UnitSource] = [one for one in LEAST_KNOWN if one in known_from]
    try:
        yield Measurement(
            channels=channels,
            read=lambda wanted: _read(file, wanted, clocks, origin, where),
            reader="TDMS",
            start="" if origin is None else f"{origin} UTC",
            time_names=tuple(dict.fromkeys(used)),
            findings=findings,
            time_unit_from=least[0] if least else "stated",
        )
    finally:
        with reading(WHAT, where):
            file.close()


def _check_lengths(file: Any, size: int) -> None:
    """Refuse channels whose stated lengths do not fill their segments; the library would fit them.

    Only the last segment of a recording that was not closed may hold less, see `check_segments`.
    """
    for segment in file._reader._segments:  # the public status tells of the last segment alone
        if segment.final_chunk_lengths_override is not None and not segment.segment_incomplete:
            raise BrokenFileError(
                f"a segment at byte {segment.position} whose channels state another length"
            )
    for group in file.groups():
        for channel in group.channels():
            if len(channel) > size:
                raise BrokenFileError(f"{len(channel)} samples of '{channel.name}' in {size} bytes")


def _clock(group: Any, claimed: Mapping[str, str | None]) -> Clock:
    """Return the channel of times of a group whose channels have no waveform properties.

    `claimed` are the labels that `[columns]` names, each with its unit or None.
    """
    channels = group.channels()
    if all(_increment(channel) is not None for channel in channels):
        return Clock()
    pool = [Column(one.name, split_name(one.name)[0], None, np.empty(0)) for one in channels]
    for label in (*claimed, *TIME_LABELS):
        for found in columns_of(label, "time_s", pool) if label else ():
            channel = channels[pool.index(found)]
            if channel.dtype.kind == "M" and len(channel):
                return Clock(channel, np.datetime64(channel[0], "us"))
            if channel.dtype.kind in "iuf":
                return Clock(channel, unit=claimed.get(label))
    return Clock()


def _increment(channel: Any) -> float | None:
    """Return the time between samples [s] from the waveform properties, None without them."""
    step = channel.properties.get("wf_increment")
    is_step = isinstance(step, int | float) and np.isfinite(step) and step > 0
    return float(step) if is_step else None


def _start(channel: Any) -> np.datetime64 | None:
    start = channel.properties.get("wf_start_time")
    return start.astype("datetime64[us]") if isinstance(start, np.datetime64) else None


def _origin(file: Any, clocks: Mapping[str, Clock]) -> np.datetime64 | None:
    """Return the earliest date of the file, from which its times count."""
    starts = [
        _start(channel)
        for group in file.groups()
        for channel in group.channels()
        if _increment(channel) is not None
    ]
    dates = [date for date in [*starts, *(clock.origin for clock in clocks.values())] if date]
    return min(dates, default=None)


def _stored(channel: Any, group: Any, file: Any) -> StoredChannel:
    texts = (channel.properties.get(key) for key in ("unit_string", "NI_UnitDescription"))
    units = [text.strip() for text in texts if isinstance(text, str) and text.strip()]
    refusal = scaling_refusal((channel.properties, group.properties, file.properties))
    kind = "f" if refusal else channel.dtype.kind
    return StoredChannel(
        name=channel.name,
        group=group.name,
        unit=units[0] if units else None,
        key=channel.path,
        text="" if kind in "fiub" else KINDS.get(kind, "raw bytes"),
        refusal=refusal,
    )


def _read(
    file: Any,
    wanted: Sequence[StoredChannel],
    clocks: Mapping[str, Clock],
    origin: np.datetime64 | None,
    where: str,
) -> list[Series]:
    found = {channel.path: channel for group in file.groups() for channel in group.channels()}
    times: dict[str, np.ndarray] = {}
    series = []
    for stored in wanted:
        at = f"{where}, channel '{stored.name}'"
        channel = found[str(stored.key)]
        clock = clocks[channel.group_name]
        with reading(WHAT, at):
            values = _numbers(channel)
            values[np.isinf(values)] = np.nan
            if _increment(channel) is not None:
                time_s = _waveform_times(channel, values.size, origin)
            elif clock.channel is not None:
                if channel.group_name not in times:
                    times[channel.group_name] = _clock_times(clock, origin, at)
                time_s = times[channel.group_name]
            else:
                time_s = None
        if time_s is not None and time_s.size != values.size:
            raise damaged(WHAT, at, f"{values.size} samples with {time_s.size} times")
        series.append(Series(values, time_s))
    return series


def _numbers(channel: Any) -> np.ndarray:
    values = np.asarray(channel.read_data())
    if values.size != len(channel):
        raise ValueError(f"{len(channel)} samples stated, {values.size} found")
    return values.astype(np.float64)


def _waveform_times(channel: Any, size: int, origin: np.datetime64 | None) -> np.ndarray:
    offset = channel.properties.get("wf_start_offset")
    start_s = float(offset) if isinstance(offset, int | float) else 0.0
    start = _start(channel)
    if start is not None and origin is not None:
        start_s += float((start - origin) / MICROSECOND) * 1e-6
    step_s = _increment(channel)
    assert step_s is not None  # asked by the caller
    return start_s + step_s * np.arange(size)


def _clock_times(clock: Clock, origin: np.datetime64 | None, where: str) -> np.ndarray:
    channel = clock.channel
    if clock.origin is not None and origin is not None:
        dates = np.asarray(channel.read_data())
        return (dates - origin) / MICROSECOND * 1e-6
    known = require_unit(_clock_unit(clock, where)[0], "time", where=f"{where}, times")
    return to_canonical(_numbers(channel), known)


def _clock_unit(clock: Clock, where: str) -> tuple[str, UnitSource]:
    """Return the unit of times that are plain numbers, and how it is known."""
    time = CHANNEL["time_s"]
    if clock.unit is not None:
        return clock.unit, "stated"
    label, said = split_name(clock.channel.name)
    stored = clock.channel.properties.get("unit_string")
    stored = stored.strip() if isinstance(stored, str) else ""
    beside = (Stated(stored, "the unit beside it"),) if stored else ()
    column = Column(clock.channel.name, label, said, np.empty(0), beside=beside)
    unit, known_from = unit_of(column, time, f"{where}, times '{clock.channel.name}'")
    return unit or time.unit, known_from
