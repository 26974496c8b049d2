"""From a path to the bytes of a file, never more of them than memory is meant to hold.

What is opened is a file, or a pipe that another program feeds (`/dev/stdin`, `/dev/fd/N`); devices,
sockets and named pipes are refused before a byte is read, since they may have no end or keep
whoever opens them waiting for ever. A pipe is read once and whole: it cannot be read again.
"""

import contextlib
import hashlib
import io
import os
import select
import stat
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from ..errors import InputError
from .whole_files import opener_of_this_thread

LARGEST_BYTES = 2**30
"""Largest file, and largest content of a compressed one: 15 million lines of 70 characters. Read
as text it takes up to eight times as much memory; a compressed file of a few kilobytes may hold
anything."""

LARGEST_NUMBERS = LARGEST_BYTES // 8
"""Most numbers of a binary file; each takes eight bytes of memory."""

GZIP_FLAG = 16 + zlib.MAX_WBITS

# Opening a named pipe that nobody writes would otherwise wait for its writer for ever.
OPEN_FLAGS = (
    os.O_RDONLY
    | getattr(os, "O_NONBLOCK", 0)
    | getattr(os, "O_NOCTTY", 0)
    | getattr(os, "O_BINARY", 0)
)
PIECE_BYTES = 2**20


@contextlib.contextmanager
def open_input(path: str | Path, largest: int | None = None) -> Iterator[BinaryIO]:
    """Open a file for the time of the context, from its start and seekable.

    Args:
        path: A file, or a pipe that another program feeds.
        largest: Most bytes that are wanted, None for `LARGEST_BYTES`; one more is taken out of a
            pipe, to tell that there are more.

    Raises:
        InputError: If it cannot be opened, or is a directory, a device, a socket or a named pipe.
    """
    with contextlib.ExitStack() as held:
        try:
            stream = _opened(path, LARGEST_BYTES if largest is None else largest, held)
        except InputError:
            raise
        except (OSError, ValueError) as error:
            raise cannot_open(error, str(path)) from error
        yield stream


def _opened(path: str | Path, largest: int, held: contextlib.ExitStack) -> BinaryIO:
    where = str(path)
    opener = opener_of_this_thread()
    if opener is not None:
        return held.enter_context(opener(Path(path)))
    refuse_special(os.stat(path), where)  # opening alone makes some devices act
    file = held.enter_context(open(os.open(path, OPEN_FLAGS), "rb"))  # noqa: SIM115
    found = os.fstat(file.fileno())
    refuse_special(found, where)
    if stat.S_ISFIFO(found.st_mode):
        return io.BytesIO(_drained(file.fileno(), largest + 1))
    return file


def read_start(path: str | Path, most: int) -> bytes:
    """Return the first bytes of a file, and one more than wanted if there are more.

    Raises:
        InputError: As `open_input`.
    """
    with open_input(path, most) as stream:
        try:
            return stream.read(most + 1)
        except OSError as error:
            raise cannot_open(error, str(path)) from error


def read_stream(stream: BinaryIO, where: str) -> bytes:
    """Return the bytes of an open bench file, from its start.

    Raises:
        InputError: If it is empty, larger than `LARGEST_BYTES`, or is being written to.
    """
    if isinstance(stream, io.BytesIO):
        data = stream.getvalue()
    else:
        before = os.fstat(stream.fileno())
        if before.st_size > LARGEST_BYTES:
            raise _too_large(f"{before.st_size / 2**20:.0f} MB", where)
        try:
            stream.seek(0)
            data = stream.read(LARGEST_BYTES + 1)
        except OSError as error:
            raise cannot_open(error, where) from error
        after = os.fstat(stream.fileno())
        was, now = ((one.st_size, one.st_mtime_ns) for one in (before, after))
        if was != now or len(data) != after.st_size:
            raise InputError(
                "The file was changed while it was read.",
                where=where,
                remedy="Wait until the recording has ended, or copy it first.",
            )
    if len(data) > LARGEST_BYTES:
        raise _too_large(f"more than {LARGEST_BYTES // 2**20} MB", where)
    if not data:
        raise InputError(
            "Expected a table, got an empty file.",
            where=where,
            remedy="Copy the file again from the bench.",
        )
    return data


def refuse_special(found: os.stat_result, where: str) -> None:
    """Refuse what is neither a file nor a pipe that another program feeds.

    A named pipe is refused even if somebody writes it: whether anybody ever will cannot be known.

    Raises:
        InputError: If it is a directory, a device, a socket or a named pipe.
    """
    mode = found.st_mode
    if stat.S_ISREG(mode) or (stat.S_ISFIFO(mode) and _is_fed(found)):
        return
    kind, remedy = "socket" if stat.S_ISSOCK(mode) else "device", "Name the file of the recording."
    if stat.S_ISDIR(mode):
        kind, remedy = "directory", "Name the files in it."
        # fit.json stands in every run folder, and in nothing that a bench writes
        if os.path.isfile(os.path.join(where, "fit.json")):
            kind = "run folder of heatrun"
            remedy = "Name the bench file that the run was made from."
    elif stat.S_ISFIFO(mode):
        kind = "named pipe"
        remedy = "Write the recording to a file first, or hand it over by: "
        remedy += "cat PIPE | heatrun check MOTOR.toml /dev/stdin"
    raise InputError(f"Expected a file, got a {kind}.", where=where, remedy=remedy)


def is_pipe(path: str | Path) -> bool:
    """Return whether a path is a pipe, whose content is gone once it was read."""
    try:
        return stat.S_ISFIFO(os.stat(path).st_mode)
    except (OSError, ValueError):
        return False


def cannot_open(error: OSError | ValueError, where: str) -> InputError:
    """Return the error for a file that the system does not open."""
    reason = getattr(error, "strerror", None) or str(error)
    return InputError(
        f"The file cannot be opened ({reason}).", where=where, remedy="Check the path."
    )


def _is_fed(found: os.stat_result) -> bool:
    """Return whether a pipe has no name in any folder, as those that a shell makes have none."""
    ends = os.pipe()
    try:
        return os.fstat(ends[0]).st_dev == found.st_dev
    finally:
        for end in ends:
            os.close(end)


def _drained(descriptor: int, most: int) -> bytes:
    """Return what comes out of a pipe until its writer closes it, at most so many bytes."""
    pieces: list[bytes] = []
    room = most
    while room:
        try:
            piece = os.read(descriptor, min(room, PIECE_BYTES))
        except BlockingIOError:  # nothing yet, and somebody may still write
            select.select([descriptor], [], [])
            continue
        if not piece:
            break
        pieces.append(piece)
        room -= len(piece)
    return b"".join(pieces)


def digest(path: str | Path) -> str:
    """Return the SHA-256 of a file's bytes as hexadecimal digits; the file is not held in memory.

    Raises:
        OSError: If it cannot be opened.
        ValueError: If no file can have this name, or it is no file.
    """
    refuse_special(os.stat(path), str(path))
    with open(os.open(path, OPEN_FLAGS), "rb") as file:
        return digest_of(file)


def digest_of(stream: BinaryIO) -> str:
    """Return the SHA-256 of an open file from its start, as hexadecimal digits."""
    stream.seek(0)
    return hashlib.file_digest(stream, "sha256").hexdigest()  # pyright: ignore[reportArgumentType]


def unzip(data: bytes, where: str) -> bytes:
    """Return the content of a gzip file, in which several members may follow each other.

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
