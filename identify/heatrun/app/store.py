"""Records in memory, shared by all tabs and bounded in bytes."""

from __future__ import annotations

import threading
from collections import OrderedDict
from dataclasses import dataclass
from pathlib import Path

from ..bench import Record
from ..bench.joined import read_whole_test
from ..bench.readers.open_file import LARGEST_BYTES
from ..bench.readers.read import read_record
from ..errors import InputError
from ..motor import Motor
from .folder import Stamp

MAX_STORED_BYTES = 2 << 30
"""Bytes of records that are kept for the next tab or test type; the oldest go first."""


@dataclass(frozen=True)
class Opened:
    """A record and the state of its file when it was read."""

    record: Record
    path: Path
    stamp: Stamp

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
        stamp = Stamp.of(path)
        if stamp.num_bytes > self._max_file_bytes:
            raise InputError(
                f"The file has {stamp.num_bytes / 1e9:.2f} GB; the view opens files up to "
                f"{self._max_file_bytes / 1e9:.2f} GB.",
                where=path.name,
                remedy="Cut the test into parts or log it at a lower rate; `--max-file-MB` sets "
                "the limit.",
            )
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
            channel.nbytes
            for opened in self._kept.values()
            for channel in opened.record.channels.values()
        )
