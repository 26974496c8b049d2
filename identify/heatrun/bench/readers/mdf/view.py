"""An MDF 4 file without what a fit never needs: history, events, attachments, comments.

The library reads attachments whole into memory when it opens a file, and parses the XML of
comments. The links to them are blanked out on the way to it, so that it finds none.
"""

from __future__ import annotations

import io
from typing import BinaryIO

HIDDEN = (96, 136)
"""First and last+1 byte of the header's links to history, hierarchy, attachments, events and
comment (ASAM MCD-4 MDF 4.2, HDBLOCK: six links from byte 88, the first leads to the data)."""


class _View(io.RawIOBase):
    """The bytes of a file, with those of `HIDDEN` read as zeros."""

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream
        self._at = 0  # its own, since our checks read the same stream in between

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = io.SEEK_SET, /) -> int:
        base = self._at if whence == io.SEEK_CUR else 0
        if whence == io.SEEK_END:
            base = self._stream.seek(0, io.SEEK_END)
        self._at = max(base + offset, 0)
        return self._at

    def readinto(self, buffer, /) -> int:
        target = memoryview(buffer).cast("B")
        self._stream.seek(self._at)
        data = self._stream.read(len(target))
        target[: len(data)] = data
        first, last = max(HIDDEN[0] - self._at, 0), min(HIDDEN[1] - self._at, len(data))
        if first < last:
            target[first:last] = bytes(last - first)
        self._at += len(data)
        return len(data)


def without_extras(stream: BinaryIO) -> io.BufferedReader:
    """Return a file whose header links to its data alone.

    Args:
        stream: The file, seekable; stays open.
    """
    return io.BufferedReader(_View(stream))
