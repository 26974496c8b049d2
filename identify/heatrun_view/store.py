"""Records in memory, shared by all tabs and bounded in bytes."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from heatrun.bench import Record
from heatrun.bench.following import FollowedTest
from heatrun.bench.joined import read_whole_test
from heatrun.bench.other_columns import Other, other_columns
from heatrun.bench.readers.open_file import LARGEST_BYTES
from heatrun.bench.readers.read import read_record
from heatrun.errors import InputError
from heatrun.io.opening import Opener, opening_by
from heatrun.motor import Motor

from .folder import Stamp

MAX_STORED_BYTES = 2 << 30
"""Bytes of records that are kept for the next tab or test type; the oldest go first."""

MAX_FOLLOWED = 100
"""Growing files that are followed at a time, those of all tabs together; the oldest go first."""


@dataclass(frozen=True)
class Opened:
    """A record and the state of its file when it was read.

    Attributes:
        record: The test.
        path: Its file.
        stamp: State of the file when it was read.
        others: The columns of numbers that are no channel, by name; None where they were not read.
        notice: What happened to a growing file, as a sentence, or empty.
        is_part: The file was being written; this is what of it was whole.
    """

    record: Record
    path: Path
    stamp: Stamp
    others: Mapping[str, Other] | None = None
    notice: str = ""
    is_part: bool = False

    def is_current(self) -> bool:
        """Return whether the file is still the one that was read."""
        return Stamp.of(self.path) == self.stamp


class RecordStore:
    """Reads each file once for as long as it does not change."""

    def __init__(self, max_file_bytes: int = LARGEST_BYTES) -> None:
        self._max_file_bytes = max_file_bytes
        self._kept: OrderedDict[tuple[Path, Stamp, str], Opened] = OrderedDict()
        self._lock = threading.Lock()
        self._reading: dict[tuple[Path, Stamp, str], threading.Lock] = {}
        self._followed: OrderedDict[tuple[Path, str], tuple[threading.Lock, FollowedTest]] = (
            OrderedDict()
        )

    def open(self, path: Path, motor: Motor | None) -> Opened:
        """Return the record of a file.

        Args:
            path: The file.
            motor: The machine, whose columns and kind of losses count; None reads the columns
                that are known without it.

        Raises:
            InputError: If the file is too large for the view, cannot be read, or changed while
                it was read.
        """
        stamp = self._stamp(path)
        key = (path, stamp, motor.sha256 if motor else "")
        with self._lock:
            if key in self._kept:
                self._kept.move_to_end(key)
                return self._kept[key]
            turn = self._reading.setdefault(key, threading.Lock())
        # who wants the same file waits for it; who wants another one does not
        with turn:
            try:
                with self._lock:
                    if key in self._kept:
                        return self._kept[key]
                opened = self._read(path, motor, stamp)
                with self._lock:
                    self._kept[key] = opened
                    while len(self._kept) > 1 and self._num_bytes() > MAX_STORED_BYTES:
                        self._kept.popitem(last=False)
                return opened
            finally:
                with self._lock:
                    self._reading.pop(key, None)

    def with_others(self, opened: Opened, opener: Opener) -> Opened:
        """Return a test with the columns that are no channel; they are read once.

        Args:
            opened: As `open` returned it.
            opener: Opens the file.

        Raises:
            InputError: If the file cannot be read any more.
        """
        if opened.others is not None:
            return opened
        with opening_by(opener):
            others = other_columns(opened.path, opened.record) if opened.record.unused else {}
        found = replace(opened, others=others)
        with self._lock:
            for key, kept in self._kept.items():
                if kept is opened:
                    self._kept[key] = found
        return found

    def follow(self, path: Path, motor: Motor | None, opener: Opener) -> Opened:
        """Return what is whole of a text file that is being written.

        What was read of it before is not read again, for none of the tabs.

        Args:
            path: The file.
            motor: As `open`.
            opener: Opens the file.

        Raises:
            InputError: If the file is too large for the view, holds no table yet, or is no text.
        """
        stamp = self._stamp(path)
        key = (path, motor.sha256 if motor else "")
        with self._lock:
            turn, test = self._followed.setdefault(
                key, (threading.Lock(), FollowedTest(path, motor))
            )
            self._followed.move_to_end(key)
            while len(self._followed) > 1 and (
                len(self._followed) > MAX_FOLLOWED
                or sum(each.num_bytes for _, each in self._followed.values()) > MAX_STORED_BYTES
            ):
                self._followed.popitem(last=False)
        with turn:
            seen = test.look(opener)
        return Opened(seen.record, path, stamp, seen.others, seen.notice, is_part=True)

    def _stamp(self, path: Path) -> Stamp:
        stamp = Stamp.of(path)
        if stamp.num_bytes > self._max_file_bytes:
            raise InputError(
                f"The file has {stamp.num_bytes / 1e9:.2f} GB; the view opens files up to "
                f"{self._max_file_bytes / 1e9:.2f} GB.",
                where=path.name,
                remedy="Cut the test into parts or log it at a lower rate; `--max-file-MB` sets "
                "the limit.",
            )
        return stamp

    def _read(self, path: Path, motor: Motor | None, stamp: Stamp) -> Opened:
        record = read_whole_test(path, motor) if motor else read_record(path)
        if Stamp.of(path) != stamp:
            raise InputError(
                "The file changed while it was read.",
                where=path.name,
                remedy="Wait until the bench has written it, and open it again.",
            )
        return Opened(record, path, stamp)

    def _num_bytes(self) -> int:
        return sum(
            values.nbytes
            for opened in self._kept.values()
            for values in (
                *opened.record.channels.values(),
                *(other.values for other in (opened.others or {}).values()),
            )
        )
