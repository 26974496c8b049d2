"""From a path to the bytes of a bench file, never more of them than memory is meant to hold."""

from __future__ import annotations

import hashlib
import os
import stat
import zlib
from pathlib import Path

from ..errors import InputError
from ..opening import open_binary

LARGEST_BYTES = 2**30
"""Largest file, and largest content of a compressed one: 15 million lines of 70 characters. Read
as text it takes up to eight times as much memory; a compressed file of a few kilobytes may hold
anything."""

LARGEST_NUMBERS = LARGEST_BYTES // 8
"""Most numbers of a binary file; each takes eight bytes of memory."""

GZIP_FLAG = 16 + zlib.MAX_WBITS


def read_file(path: str | Path) -> bytes:
    """Return the bytes of a file.

    Args:
        path: A file, or a pipe.

    Raises:
        InputError: If it cannot be opened, is empty, larger than `LARGEST_BYTES`, or is being
            written to.
    """
    where = str(path)
    try:
        with open_binary(path) as file:
            before = os.fstat(file.fileno())
            if stat.S_ISCHR(before.st_mode) or stat.S_ISBLK(before.st_mode):
                raise InputError("Expected a file, got a device.", where=where)
            if before.st_size > LARGEST_BYTES:
                raise _too_large(f"{before.st_size / 2**20:.0f} MB", where)
            data = file.read(LARGEST_BYTES + 1)
            after = os.fstat(file.fileno())
    except IsADirectoryError as error:
        raise InputError(
            "Expected a file, got a directory.", where=where, remedy="Name the files in it."
        ) from error
    except InputError:
        raise
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(
            f"The file cannot be opened ({reason}).", where=where, remedy="Check the path."
        ) from error
    if len(data) > LARGEST_BYTES:
        raise _too_large(f"more than {LARGEST_BYTES // 2**20} MB", where)
    if stat.S_ISREG(before.st_mode) and (
        (before.st_size, before.st_mtime_ns) != (after.st_size, after.st_mtime_ns)
        or len(data) != after.st_size
    ):
        raise InputError(
            "The file was changed while it was read.",
            where=where,
            remedy="Wait until the recording has ended, or copy it first.",
        )
    if not data:
        raise InputError(
            "Expected a table, got an empty file.",
            where=where,
            remedy="Copy the file again from the bench.",
        )
    return data


def digest(path: str | Path) -> str:
    """Return the SHA-256 of a file's bytes as hexadecimal digits; the file is not held in memory.

    Raises:
        OSError: If it cannot be opened.
        ValueError: If no file can have this name.
    """
    with open_binary(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def unzip(data: bytes, where: str) -> bytes:
    """Return the content of a gzip file.

    Args:
        data: Its bytes; several members may follow each other.
        where: The file, for messages.

    Raises:
        InputError: If it is damaged or cut, or holds more than `LARGEST_BYTES`.
    """
    parts: list[bytes] = []
    room = LARGEST_BYTES
    rest = data
    while rest:
        machine = zlib.decompressobj(GZIP_FLAG)
        try:
            parts.append(machine.decompress(rest, room + 1))
        except zlib.error as error:
            raise _damaged(str(error), where) from error
        room -= len(parts[-1])
        if room < 0:
            raise _too_large(f"more than {LARGEST_BYTES // 2**20} MB unpacked", where)
        if not machine.eof:
            raise _damaged("it ends before its end mark", where)
        # zero bytes behind the last member are padding
        rest = machine.unused_data.lstrip(b"\0")
    return b"".join(parts)


def _damaged(problem: str, where: str) -> InputError:
    return InputError(
        f"The gzip file is damaged or cut ({problem}).",
        where=where,
        remedy="Copy the file again from the bench.",
    )


def _too_large(size: str, where: str) -> InputError:
    return InputError(
        f"Expected a file of at most {LARGEST_BYTES // 2**20} MB, got {size}.",
        where=where,
        remedy="Export at a lower rate, only the columns needed, or the tests one by one.",
    )
