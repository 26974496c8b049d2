"""The end of a text file that is being written: its new whole lines, each of them read once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import BinaryIO, Literal

MARK_BYTES = 4096
"""Bytes at both ends of what was read that must still be there for a file to be the same."""

MOST_BYTES = 32 << 20
"""Most that one look reads [byte]; what is more waits for the next one."""


@dataclass(frozen=True)
class Grown:
    """What a look at a file has brought.

    Attributes:
        kind: `"start"` for the first lines of a file, `"more"` for those behind the ones that were
            read, `"replaced"` if those are not there any more and the file must be read anew.
        data: Whole lines, the last with its line end; empty if there are none.
    """

    kind: Literal["start", "more", "replaced"]
    data: bytes


class Growth:
    """Follows a file that a bench appends lines to.

    A line counts once its line end is there, so a torn one waits for the next look. A file counts
    as the same one while what was read of it still stands at its place: the first and the last
    `MARK_BYTES` of it are compared, at each look, so that the cost of a look depends on what is new
    and not on the length of the file.
    """

    def __init__(self) -> None:
        self._head = b""
        self._tail = b""
        self._num_read = 0

    @property
    def num_read(self) -> int:
        """Bytes of the file that were read."""
        return self._num_read

    def look(self, file: BinaryIO) -> Grown:
        """Return what is new in the file.

        After `"replaced"` the next look begins at the start.

        Args:
            file: Open for reading and seekable; the writer may go on meanwhile.
        """
        if self._num_read == 0:
            return self._read(file, "start")
        if not self._is_same(file):
            self._head, self._tail, self._num_read = b"", b"", 0
            return Grown("replaced", b"")
        return self._read(file, "more")

    def _is_same(self, file: BinaryIO) -> bool:
        file.seek(0)
        if file.read(len(self._head)) != self._head:
            return False
        file.seek(self._num_read - len(self._tail))
        return file.read(len(self._tail)) == self._tail

    def _read(self, file: BinaryIO, kind: Literal["start", "more"]) -> Grown:
        file.seek(self._num_read)
        data = file.read(MOST_BYTES)
        data = data[: data.rfind(b"\n") + 1]
        if data:
            self._num_read += len(data)
            self._head = (self._head + data[: MARK_BYTES - len(self._head)])[:MARK_BYTES]
            self._tail = (self._tail + data)[-MARK_BYTES:]
        return Grown(kind, data)
