"""A test that is still being written, read again and again as it grows.

The first look reads what is there like any file. A later one reads the new lines under the head of
the file, behind lines that are known already: where these come out as they did before, the rows
behind them are what reading the whole file would give. Where not, the whole file is read, and so
seldom that it takes a small share of the time.
"""

import io
import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import BinaryIO

import numpy as np

from ..errors import InputError
from ..io.whole_files import Opener, opening_by
from ..record.motor import Motor
from ..record.record import Record
from ..record.table import Table
from .joined import read_whole_test
from .read import is_text_table, name_of_test, read_record, read_whole
from .text.reader import head_of, hints_of, with_missing_rows

SAME_CLOCK_S = 1e-3
"""Rounding of a 32-bit clock after hours [s]; a larger difference is another clock."""

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
    """A column of numbers that is no channel."""

    values: np.ndarray  # As they stand in the file, shape (time,).
    unit: str = ""  # Unit text of the file, or empty.


def others_of(table: Table, record: Record) -> dict[str, Other]:
    """Return the columns of numbers of a table that are no channel of its record, by name.

    Those that are not on its time axis are left out.
    """
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


MARK_BYTES = 4096
"""Bytes at both ends of what was read that must still be there for a file to be the same."""

MOST_BYTES = 32 << 20
"""Most that one look reads [byte]; what is more waits for the next one."""


class Growth:
    """The end of a file that a bench appends lines to.

    A line counts once its line end is there, so a torn one waits for the next look. A file counts
    as the same one while what was read of it still stands at its place: the first and the last
    `MARK_BYTES` of it are compared, at each look, so that the cost of a look depends on what is new
    and not on the length of the file.
    """

    def __init__(self) -> None:
        self._head = b""
        self._tail = b""
        self.num_read = 0

    def look(self, file: BinaryIO) -> bytes | None:
        """Return the new whole lines of an open file, whose writer may go on meanwhile.

        None if what was read is not there any more: the next look begins at the start.
        """
        file.seek(0)
        is_same = file.read(len(self._head)) == self._head
        file.seek(self.num_read - len(self._tail))
        if not is_same or file.read(len(self._tail)) != self._tail:
            self._head, self._tail, self.num_read = b"", b"", 0
            return None
        data = file.read(MOST_BYTES)
        data = data[: data.rfind(b"\n") + 1]
        self.num_read += len(data)
        self._head = (self._head + data[:MARK_BYTES])[:MARK_BYTES]
        self._tail = (self._tail + data)[-MARK_BYTES:]
        return data


BUSY_SHARE = 0.05
"""Share of the time that reading the whole file again may take."""

KNOWN_BYTES = 2000
"""Lines that are known already and read again in front of new ones [byte]; up to twice as many."""

HEAD_BYTES = 4096
"""Beginning of a file that tells its format [byte]."""


@dataclass(frozen=True)
class Followed:
    """A growing test at one look."""

    record: Record  # What of it is whole.
    # The columns of numbers that are no channel, by name.
    others: Mapping[str, Other] = field(default_factory=dict)
    notice: str = ""  # What happened to the file, as a sentence, or empty.


@dataclass
class _Known:
    """What is known of the file since it was read whole."""

    record: Record  # As it was read then, without its channels.
    num_rows: int  # Rows that it had.
    channels: GrowingColumns
    others: GrowingColumns
    other_units: Mapping[str, str]
    # What stands above the data; None if new lines cannot be read under it.
    head: bytes | None = None
    lines: bytes = b""  # The last lines.
    anchor: int = 0  # Row that the first of them is.
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
        if not is_text_table(file.read(HEAD_BYTES), str(self._path)):
            raise NotFollowed(
                "Only text tables can be followed while they are written.",
                where=self._path.name,
                remedy="Let the bench log to CSV, or look again when the test has ended.",
            )
        data = self._growth.look(file)
        if data is None:
            at = time.strftime("%H:%M:%S")
            self._notice = f"The file was replaced or cut at {at}: it is read from its start again."
            self._known = self._seen = None
            data = self._growth.look(file) or b""
        known = self._known
        if known is None:
            self._start(data)
        elif data or self._is_behind:
            self._go_on(known, data, file)
        elif self._seen is not None:
            return self._seen
        self._seen = self._snapshot()
        return self._seen

    def _start(self, data: bytes) -> None:
        try:
            if not data:
                raise InputError("There is no whole line in the file yet.", where=self._path.name)
            self._known = self._read_whole(data)
        except InputError:
            self._growth = Growth()
            raise

    def _read(self, data: bytes) -> tuple[Record, dict[str, Other]]:
        """Read whole lines like a file of its own."""
        where, motor = str(self._path), self._motor
        with opening_by(lambda _: io.BytesIO(data)):
            record = read_whole_test(where, motor) if motor else read_record(where)
        others = others_of(read_whole(io.BytesIO(data), where), record) if record.unused else {}
        return record, others

    def _read_whole(self, data: bytes) -> _Known:
        begun_s = time.monotonic()
        record, others = self._read(data)
        known = _Known(
            replace(record, channels={}),  # the rows stand in `channels`
            record.time_s.size,
            GrowingColumns(record.channels),
            GrowingColumns({name: other.values for name, other in others.items()}),
            {name: other.unit for name, other in others.items()},
        )
        motor = self._motor
        hints = hints_of(
            motor.columns_of(name_of_test(self._path)) if motor else None,
            motor.decimal if motor else None,
            where=str(self._path),
        )
        known.head = head_of(data, str(self._path), hints)
        if known.head is not None:
            self._keep_last(known, data[len(known.head) :])
        self._read_at_s, self._is_behind = time.monotonic(), False
        self._took_s = self._read_at_s - begun_s
        return known

    def _keep_last(self, known: _Known, lines: bytes) -> None:
        """Keep the last lines, if they alone are read as they were."""
        cut = len(lines) - KNOWN_BYTES
        known.lines = lines[lines.find(b"\n", cut) + 1 :] if cut > 0 else lines
        try:
            record, _ = self._read((known.head or b"") + known.lines)
        except InputError:
            known.head = None
            return
        known.anchor = known.channels.num_rows - record.time_s.size
        if _continued(known, record) is None:
            known.head = None

    def _go_on(self, known: _Known, data: bytes, file: BinaryIO) -> None:
        if not self._is_behind:
            self._is_behind = not self._add(known, data)
        rested_s = time.monotonic() - self._read_at_s
        if not self._is_behind or rested_s < self._took_s / BUSY_SHARE:
            return
        file.seek(0)
        try:
            self._known = self._read_whole(file.read(self._growth.num_read))
        except InputError as error:
            self._notice, self._is_behind = str(error), False
            self._read_at_s = time.monotonic()

    def _add(self, known: _Known, data: bytes) -> bool:
        """Add new lines; return whether they were understood as the whole file would be."""
        if known.head is None:
            return False
        known.lines += data
        try:
            record, others = self._read(known.head + known.lines)
        except InputError:
            return False
        channels = _continued(known, record)
        if channels is None or others.keys() - known.other_units.keys():
            return False
        overlap = known.channels.num_rows - known.anchor
        num_new = record.time_s.size - overlap
        known.channels.add({name: values[overlap:] for name, values in channels.items()}, num_new)
        rows = {name: other.values[overlap:] for name, other in others.items()}
        known.others.add(rows, num_new)
        known.num_lost += sum(bool(line.strip()) for line in data.split(b"\n")) - num_new
        if len(known.lines) > 2 * KNOWN_BYTES:
            self._keep_last(known, known.lines)
        return True

    def _snapshot(self) -> Followed:
        known = self._known
        assert known is not None
        lost = f"{known.num_lost} of the lines written since hold no sample."
        first, is_grown = known.record, known.channels.num_rows > known.num_rows
        record = replace(
            first,
            channels=known.channels.views(),
            notes=(*first.notes, lost) if known.num_lost > 0 else first.notes,
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


def _continued(known: _Known, record: Record) -> dict[str, np.ndarray] | None:
    """Channels of a record of the last lines, its clock as before; None if it begins otherwise."""
    before = {name: values[known.anchor :] for name, values in known.channels.views().items()}
    overlap, time_s = before["time_s"].size, record.time_s
    with_time = np.flatnonzero(np.isfinite(time_s[:overlap]))
    if known.anchor < 0 or time_s.size < overlap or not with_time.size:
        return None
    at = with_time[-1]
    shift_s = before["time_s"][at] - time_s[at]
    channels = {**record.channels, "time_s": time_s + shift_s}
    missing = np.full(time_s.size, np.nan)
    is_same = channels.keys() <= before.keys() and all(
        np.allclose(
            channels.get(name, missing)[:overlap], values, rtol=1e-9, equal_nan=True,
            atol=SAME_CLOCK_S if name == "time_s" else 1e-12,
        )
        for name, values in before.items()
    )  # fmt: skip
    return channels if is_same else None
