"""A test that is still being written, read again and again as it grows.

The first look reads what is there like any file; the later ones parse the new lines alone and
convert them as the first ones were. Where that would not give what reading the whole file gives,
the whole file is read, and so seldom that it takes a small share of the time.

How the further rows of a growing test become channels: as its first ones did.

Columns that grow: what was handed out stays as it is, and a row costs the same however many
there are.

The columns of a file that no channel claims, for whoever wants to look at them.
"""

from __future__ import annotations

import io
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import BinaryIO

import numpy as np

from ..errors import InputError
from ..io.whole_files import Opener, opening_by
from ..record.channels import CHANNEL, COMBINED, combine, split_parts
from ..record.derive import derive
from ..record.motor import Motor
from ..record.record import ColumnReading, Record
from ..record.table import Table
from ..record.units import Unit, find_unit, to_canonical
from .hints import hints_of
from .joined import read_whole_test
from .read import is_text_table, name_of_test, read_raw, read_record, read_whole
from .text.reader import ColumnHead, Rows, TextForm, form_of, further_rows, with_missing_rows
from .text.values import Growth

SAME_CLOCK_S = 1e-3
"""Rounding of a 32-bit clock after hours [s]; a larger shift is a clock that was wrapped."""

LONGEST_STEP_S = 43_200.0
"""A longer step between rows, or one back, says that a clock was not understood [s]."""


@dataclass(frozen=True)
class Origin:
    """What a channel is read from.

    Attributes:
        columns: One column, or those that are combined.
        unit: Their unit.
        how: As `heatrun.record.channels.combine`; empty for one column.
    """

    columns: tuple[str, ...]
    unit: Unit
    how: str = ""


@dataclass(frozen=True)
class Conversion:
    """What turns columns of a file into the channels of a record.

    Attributes:
        origins: Canonical name to what it is read from.
        motor: The machine.
        step_s: Step of a time that is made from a rate [s], None for a file with its own.
    """

    origins: Mapping[str, Origin]
    motor: Motor
    step_s: float | None

    @classmethod
    def of(cls, record: Record, motor: Motor | None, heads: Sequence[ColumnHead]) -> Conversion:
        """Take how a record that was read from the beginning of a file came about."""
        origins = {
            one.channel: origin
            for one in record.mapping
            if (origin := _origin(one, heads)) is not None
        }
        has_rate = "time_s" not in origins and record.time_s.size > 1
        step_s = record.duration_s / (record.time_s.size - 1) if has_rate else None
        return cls(origins, motor or Motor(""), step_s)

    @property
    def columns(self) -> frozenset[str]:
        """The columns of the file that are channels."""
        return frozenset(name for origin in self.origins.values() for name in origin.columns)

    def channels(
        self, rows: Rows, last_s: float, shift_s: float
    ) -> tuple[dict[str, np.ndarray], float]:
        """Return the channels of rows, shape (row,), and what their times are shifted by [s].

        The first row is the last one that is known already, at `last_s` [s], NaN if it has no time;
        `shift_s` was added to the times of the file so far.
        """
        found = {
            name: _values(name, origin, rows)
            for name, origin in self.origins.items()
            if all(column in rows.values for column in origin.columns)
        }
        if self.step_s is not None:
            found["time_s"] = last_s + self.step_s * np.arange(rows.num_rows)
        elif "time_s" in found:
            here_s = float(found["time_s"][0])
            if not abs(here_s + shift_s - last_s) < SAME_CLOCK_S and np.isfinite(here_s + last_s):
                shift_s = last_s - here_s
            found["time_s"] = found["time_s"] + shift_s
        motor = self.motor
        found, _ = derive(
            found, phases=motor.phases, losses=motor.losses, constants=motor.constants
        )
        return found, shift_s


def _origin(reading: ColumnReading, heads: Sequence[ColumnHead]) -> Origin | None:
    """Return what a channel is read from; None where that cannot be told from its reading."""
    unit = find_unit(reading.unit, CHANNEL[reading.channel].quantity)
    several = COMBINED.fullmatch(reading.column)
    if unit is None or several is None:
        return None if unit is None else Origin((reading.column,), unit)
    parts = [part.partition("[")[0].strip() for part in split_parts(several["parts"])]
    names = [
        next((head.name for head in heads if part in (head.name, head.label)), "") for part in parts
    ]
    return Origin(tuple(names), unit, several["how"]) if all(names) else None


def _values(channel: str, origin: Origin, rows: Rows) -> np.ndarray:
    parts = [to_canonical(rows.values[column], origin.unit) for column in origin.columns]
    return combine(channel, origin.how, parts) if origin.how else parts[0]


def agrees(found: Mapping[str, np.ndarray], record: Record, num_rows: int) -> bool:
    """Return whether channels of further rows, shape (row,), are what the record of the whole file
    holds in so many rows at its end.
    """
    return all(
        name in found
        and np.allclose(
            found[name][-num_rows:], values[-num_rows:], rtol=1e-9, equal_nan=True,
            atol=SAME_CLOCK_S if name == "time_s" else 1e-12,
        )
        for name, values in record.channels.items()
    )  # fmt: skip


def is_steady(time_s: np.ndarray) -> bool:
    """Return whether times [s], the last known one in front, go on as a clock does."""
    steps = np.diff(time_s[np.isfinite(time_s)])
    return bool(np.all((steps >= 0.0) & (steps <= LONGEST_STEP_S)))


FIRST_ROWS = 1024


class GrowingColumns:
    """Columns of one length to which rows are added.

    The arrays that `views` hands out are never written to again: further rows go behind them, or
    into arrays of twice the size.
    """

    def __init__(self, columns: Mapping[str, np.ndarray]) -> None:
        self._num_rows = len(next(iter(columns.values()))) if columns else 0
        self._held = {name: self._with_room(values) for name, values in columns.items()}

    @property
    def num_rows(self) -> int:
        """How many rows there are."""
        return self._num_rows

    @property
    def num_bytes(self) -> int:
        """Memory that they take [byte]."""
        return sum(held.nbytes for held in self._held.values())

    def add(self, rows: Mapping[str, np.ndarray], num_rows: int) -> None:
        """Add rows by column, shape (new,); a column that is not there gets NaN."""
        end = self._num_rows + num_rows
        for name, held in self._held.items():
            if end > held.size:
                held = self._held[name] = self._with_room(held[: self._num_rows], end)
            held[self._num_rows : end] = rows.get(name, np.nan)
        self._num_rows = end

    def views(self) -> dict[str, np.ndarray]:
        """Return the columns as they are now, shape (row,) each."""
        found = {name: held[: self._num_rows] for name, held in self._held.items()}
        for view in found.values():
            view.flags.writeable = False
        return found

    @staticmethod
    def _with_room(values: np.ndarray, least: int = FIRST_ROWS) -> np.ndarray:
        room = np.full(max(2 * values.size, 2 * least), np.nan)
        room[: values.size] = values
        return room


@dataclass(frozen=True)
class Other:
    """A column of numbers that is no channel.

    Attributes:
        values: As they stand in the file, shape (time,).
        unit: Unit text of the file, or empty.
    """

    values: np.ndarray
    unit: str = ""


def other_columns(path: Path, record: Record) -> dict[str, Other]:
    """Return the columns of numbers of a record's file that are no channel, by name.

    Those that are not on its time axis are left out.

    Raises:
        InputError: If the file cannot be read.
    """
    return others_of(read_raw(path), record)


def others_of(table: Table, record: Record) -> dict[str, Other]:
    """Return the columns of numbers of a table that are no channel of its record, by name."""
    held: Mapping[str, np.ndarray] = {
        column.name: column.values for column in table.columns if column.name in record.unused
    }
    if table.num_rows < record.time_s.size and table.sample_numbers is not None and held:
        held = with_missing_rows(held, table.sample_numbers)
    units = {column.name: column.unit or "" for column in table.columns}
    return {
        name: Other(values, units[name])
        for name, values in held.items()
        if values.size == record.time_s.size and np.isfinite(values).any()
    }


BUSY_SHARE = 0.05
"""Share of the time that reading the whole file again may take."""

TRIED_BYTES = 20_000
"""Last lines of the first look [byte] on which the reading of further lines is tried."""

HEAD_BYTES = 4096
"""Beginning of a file that tells its format [byte]."""


@dataclass(frozen=True)
class Followed:
    """A growing test at one look.

    Attributes:
        record: What of it is whole.
        others: The columns of numbers that are no channel, by name.
        notice: What happened to the file, as a sentence, or empty.
    """

    record: Record
    others: Mapping[str, Other] = field(default_factory=dict)
    notice: str = ""


@dataclass
class _Known:
    """What is known of the file since it was read whole."""

    record: Record
    num_rows: int
    conversion: Conversion
    form: TextForm | None
    channels: GrowingColumns
    others: GrowingColumns
    other_units: Mapping[str, str]
    last: bytes = b""
    last_s: float = np.nan
    shift_s: float = 0.0
    num_lost: int = 0


class NotFollowed(InputError):
    """The file is of a format that cannot be read while it is written."""


class FollowedTest:
    """Follows one text file that grows by lines.

    Args:
        path: The file.
        motor: The machine; None reads the columns that are known without it.
    """

    def __init__(self, path: Path, motor: Motor | None) -> None:
        self._path, self._motor = path, motor
        self._growth = Growth()
        self._known: _Known | None = None
        self._seen: Followed | None = None
        self._notice = ""
        self._is_behind = False
        self._read_at_s, self._took_s = 0.0, 0.0

    @property
    def num_bytes(self) -> int:
        """Memory that the rows take [byte]."""
        known = self._known
        return 0 if known is None else known.channels.num_bytes + known.others.num_bytes

    def look(self, opener: Opener) -> Followed:
        """Return the test with what was written since the last look.

        Raises:
            InputError: If there is no table in it yet, it cannot be opened, or is no text.
        """
        try:
            with opener(self._path) as file:
                return self._look(file)
        except OSError as error:
            raise InputError(
                f"The file cannot be read ({error.strerror}).", where=self._path.name
            ) from error

    def _look(self, file: BinaryIO) -> Followed:
        self._refuse_other_formats(file)
        grown = self._growth.look(file)
        if grown.kind == "replaced":
            at = time.strftime("%H:%M:%S")
            self._notice = f"The file was replaced or cut at {at}: it is read from its start again."
            self._known = self._seen = None
            grown = self._growth.look(file)
        known = self._known
        if known is None:
            self._start(grown.data)
        elif grown.data or self._is_behind:
            self._go_on(known, grown.data, file)
        elif self._seen is not None:
            return self._seen
        self._seen = self._snapshot()
        return self._seen

    def _refuse_other_formats(self, file: BinaryIO) -> None:
        if not is_text_table(file.read(HEAD_BYTES), str(self._path)):
            raise NotFollowed(
                "Only text tables can be followed while they are written.",
                where=self._path.name,
                remedy="Let the bench log to CSV, or look again when the test has ended.",
            )

    def _start(self, data: bytes) -> None:
        try:
            if not data:
                raise InputError("There is no whole line in the file yet.", where=self._path.name)
            self._known = self._read_whole(data)
        except InputError:
            self._growth = Growth()
            raise

    def _read_whole(self, data: bytes) -> _Known:
        """Read whole lines from the start of the file like a file of its own."""
        begun_s = time.monotonic()
        where, motor = str(self._path), self._motor
        with opening_by(lambda _: io.BytesIO(data)):
            record = read_whole_test(where, motor) if motor else read_record(where)
        table = read_whole(io.BytesIO(data), where)
        hints = hints_of(
            motor.columns_of(name_of_test(self._path)) if motor else None,
            motor.decimal if motor else None,
            where=where,
        )
        others = others_of(table, record)
        form = form_of(data, where, hints)
        known = _Known(
            record,
            record.time_s.size,
            Conversion.of(record, motor, form.heads if form else ()),
            form,
            GrowingColumns(record.channels),
            GrowingColumns({name: other.values for name, other in others.items()}),
            {name: other.unit for name, other in others.items()},
        )
        self._try(known, data)
        known.record = replace(record, channels={})  # the rows stand in `channels`
        self._read_at_s, self._is_behind = time.monotonic(), False
        self._took_s = self._read_at_s - begun_s
        return known

    def _try(self, known: _Known, data: bytes) -> None:
        """Read the last lines once more as further ones; if they differ, it is not done so."""
        if known.form is None:
            return
        cut = len(data) - TRIED_BYTES
        rows = further_rows(data[data.find(b"\n", cut) + 1 if cut > 0 else 0 :], known.form, "")
        time_s = known.record.time_s
        num_rows = min(rows.num_rows, time_s.size)
        raw, _ = known.conversion.channels(rows, 0.0, 0.0)
        if num_rows == 0 or "time_s" not in raw or not np.isfinite(time_s[-1]):
            known.form = None
            return
        known.last, known.last_s = rows.last, float(time_s[-1])
        known.shift_s = known.last_s - float(raw["time_s"][-1])
        found = {**raw, "time_s": raw["time_s"] + known.shift_s}
        if not agrees(found, known.record, num_rows):
            known.form = None

    def _go_on(self, known: _Known, data: bytes, file: BinaryIO) -> None:
        is_odd = known.form is None or self._is_behind
        if known.form is not None and data:
            try:
                is_odd = not self._add(known, data, known.form) or is_odd
            except InputError:  # a quotation mark that is not closed
                is_odd = True
        self._is_behind = is_odd
        rested_s = time.monotonic() - self._read_at_s
        if not is_odd or rested_s < self._took_s / BUSY_SHARE:
            return
        file.seek(0)
        try:
            self._known = self._read_whole(file.read(self._growth.num_read))
        except InputError as error:
            self._notice, self._is_behind = str(error), False
            self._read_at_s = time.monotonic()

    def _add(self, known: _Known, data: bytes, form: TextForm) -> bool:
        """Add new lines; return whether they were understood as the whole file would be."""
        rows = further_rows(known.last + data, form, str(self._path))
        num_new = rows.num_rows - 1
        known.num_lost += rows.num_lost
        if num_new < 1:
            return not rows.num_lost
        channels, known.shift_s = known.conversion.channels(rows, known.last_s, known.shift_s)
        time_s = channels.get("time_s", np.full(rows.num_rows, np.nan))
        known.channels.add({name: values[1:] for name, values in channels.items()}, num_new)
        known.others.add({name: values[1:] for name, values in rows.values.items()}, num_new)
        known.last = rows.last
        with_time = np.flatnonzero(np.isfinite(time_s))
        known.last_s = float(time_s[with_time[-1]]) if with_time.size else known.last_s
        names = known.conversion.columns
        is_new = any(
            name not in names and name not in known.other_units and np.isfinite(values[1:]).any()
            for name, values in rows.values.items()
        )
        has_gap = bool(rows.num_lost) and known.conversion.step_s is not None
        return not (rows.odd & names or is_new or has_gap) and is_steady(time_s)

    def _snapshot(self) -> Followed:
        known = self._known
        assert known is not None
        lost = (
            (f"{known.num_lost} of the lines written since hold no sample.",)
            if known.num_lost
            else ()
        )
        is_grown = known.channels.num_rows > known.num_rows
        first = known.record
        record = replace(
            first,
            channels=known.channels.views(),
            notes=(*first.notes, *lost),
            # what is shown is no file that a run could have been made from
            sources=tuple(replace(one, sha256="") for one in first.sources)
            if is_grown
            else first.sources,
        )
        others = {
            name: Other(values, known.other_units.get(name, ""))
            for name, values in known.others.views().items()
        }
        return Followed(record, others, self._notice)
