"""The folder that the live view shows, nothing outside it, and its records in memory.

The records are shared by all tabs and bounded in bytes. Files that the browser sends are of limited
size, have harmless names, and lie in a folder of their own.
"""

from __future__ import annotations

import os
import re
import threading
import unicodedata
from collections import OrderedDict
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from io import BufferedReader
from pathlib import Path
from typing import Any

import panel as pn

from heatrun.errors import InputError
from heatrun.io.open_file import LARGEST_BYTES
from heatrun.io.own_files import ENDINGS, MACHINES, MOST_BYTES, SIMULATION, own_file
from heatrun.io.whole_files import Opener, opening_by, write_whole
from heatrun.readers.following import FollowedTest, Other, others_of
from heatrun.readers.joined import read_whole_test
from heatrun.readers.read import read_raw, read_record
from heatrun.record.motor import Motor
from heatrun.record.record import Record
from heatrun.runs.run_folder import MANIFEST

from .gate import is_inside, open_inside, outside

MAX_DEPTH = 3
"""Levels of folders that are searched, the folder itself included."""

MAX_ENTRIES = 5000
"""Directory entries that are looked at; a folder with more is cut, and the page says so."""

MAX_MOTOR_BYTES = 1 << 20
"""Beginning of a TOML file in which the table `[motor]` is looked for [byte]."""

MAX_SCANNED_BYTES = 32 << 20
"""What is read of all TOML files together; those beyond are not offered as motor files [byte]."""

MOTOR = re.compile(
    rb"""^(?:\xef\xbb\xbf)?[ \t]*(?:\[[ \t]*)?(?:motor|"motor"|'motor')[ \t]*[\].=]""", re.MULTILINE
)
"""What makes a TOML file a motor file: the table `[motor]`, or a key of it. The file is not parsed
for it, so that none of a thousand can hold up or end the list of the others."""

FLEET = re.compile(rb"^[ \t]*\[[ \t]*fleet[ \t]*\]", re.MULTILINE)
"""What makes a TOML file a fleet file, which may name a motor file for all machines."""


@dataclass(frozen=True)
class Stamp:
    """Size [byte] and time of change [ns] of a file: another one means another content."""

    num_bytes: int
    changed_ns: int

    @classmethod
    def of(cls, path: Path) -> Stamp:
        """Return the stamp of a file; `NOTHING` where there is none."""
        try:
            status = path.stat()
        except OSError:
            return NOTHING
        return cls(status.st_size, status.st_mtime_ns)


NOTHING = Stamp(-1, -1)
"""The stamp where there is no file."""


@dataclass(frozen=True)
class Listing:
    """What a folder holds, by name relative to it."""

    tests: tuple[str, ...]  # Bench files.
    # Virtual records that heatrun has simulated, to be looked at beside the tests.
    simulated: tuple[str, ...]
    motors: tuple[str, ...]  # Motor files: TOML with a table `[motor]`.
    is_cut: bool  # Whether there was more than is looked at.
    num_own: int = 0  # Other files that heatrun itself has written, which are not listed.


class Folder:
    """A folder of tests and motor files; its root has links resolved."""

    def __init__(self, root: Path) -> None:
        if not root.is_dir():
            raise InputError(
                "Expected a folder with tests and a motor file, and there is none.",
                where=str(root),
                remedy="Name an existing folder: heatrun view DIR.",
            )
        self.root = root.resolve()

    def path(self, name: str) -> Path:
        """Return the path of a file in the folder, named relative to it.

        Raises:
            InputError: If it is not a file, or lies outside the folder by `..`, by an absolute
                path or through a link.
        """
        if not is_inside(self.root, self.root / name):
            raise outside(name)
        return (self.root / name).resolve()

    def open(self, path: Path) -> BufferedReader:
        """Open a file in the folder for reading; it is judged again, as it is opened.

        Raises:
            InputError: As `path`.
        """
        return open_inside(self.root, path)

    def list(self) -> Listing:
        """Return what the folder holds; runs, hidden files and links that lead out are left out."""
        tests: list[str] = []
        simulated: list[str] = []
        motors: list[str] = []
        num_seen = num_own = 0
        room = MAX_SCANNED_BYTES
        for path in self._files():
            num_seen += 1
            if num_seen > MAX_ENTRIES:
                break
            name = path.relative_to(self.root).as_posix()
            if _ending(path.name) in ENDINGS:
                said = own_file(path.name, self._start(path, MOST_BYTES))
                if said in (None, SIMULATION):
                    (simulated if said else tests).append(name)
                elif said != MACHINES:  # which the bench has written
                    num_own += 1
            elif path.suffix.lower() == ".toml":
                start = self._start(path, room)
                room -= len(start)
                if MOTOR.search(start) and not FLEET.search(start):
                    motors.append(name)
        for names in (tests, simulated, motors):
            # the files of the folder itself come first
            names.sort(key=lambda name: (name.count("/"), name))
        is_cut = num_seen > MAX_ENTRIES
        return Listing(tuple(tests), tuple(simulated), tuple(motors), is_cut, num_own)

    def _files(self) -> Iterator[Path]:
        for where, folders, files in os.walk(self.root):
            here = Path(where)
            depth = len(here.relative_to(self.root).parts) + 1
            folders[:] = sorted(
                name
                for name in folders
                if depth < MAX_DEPTH
                and not name.startswith(".")
                and not name.endswith(".partial")
                and not (here / name / MANIFEST).exists()
            )
            for name in sorted(files):
                path = here / name
                if not name.startswith(".") and is_inside(self.root, path):
                    yield path

    def _start(self, path: Path, room: int) -> bytes:
        try:
            with self.open(path) as file:
                return file.read(min(room, MAX_MOTOR_BYTES))
        except (OSError, InputError):
            return b""


def _ending(name: str) -> str:
    return Path(name.lower().removesuffix(".gz")).suffix


MAX_STORED_BYTES = 2 << 30
"""Bytes of records that are kept for the next tab or test type; the oldest go first."""

MAX_FOLLOWED = 100
"""Growing files that are followed at a time, those of all tabs together; the oldest go first."""


@dataclass(frozen=True)
class Opened:
    """A record and the state of its file when it was read."""

    record: Record
    path: Path
    stamp: Stamp
    # The columns of numbers that are no channel, by name; None where they were not read.
    others: Mapping[str, Other] | None = None
    notice: str = ""  # What happened to a growing file, as a sentence, or empty.
    is_part: bool = False  # The file was being written; this is what of it was whole.

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
        """Return the record of a file, by the columns and kind of losses of a machine if given.

        Raises:
            InputError: If the file is too large for the view, cannot be read, or changed while
                it was read.
        """
        stamp = self._stamp(path)
        key = (path, stamp, motor.sha256 if motor else "")
        with self._lock:
            turn = self._reading.setdefault(key, threading.Lock())
        # who wants the same file waits for it; who wants another one does not
        with turn:
            try:
                with self._lock:
                    if key in self._kept:
                        self._kept.move_to_end(key)
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

        Raises:
            InputError: If the file cannot be read any more.
        """
        if opened.others is not None:
            return opened
        with opening_by(opener):
            read = opened.record
            others = others_of(read_raw(opened.path), read) if read.unused else {}
        found = replace(opened, others=others)
        with self._lock:
            for key, kept in self._kept.items():
                if kept is opened:
                    self._kept[key] = found
        return found

    def follow(self, path: Path, motor: Motor | None, opener: Opener) -> Opened:
        """Return what is whole of a text file that is being written.

        What was read of it before is not read again, for none of the tabs.

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


MAX_NAME = 100
"""Longest file name that is kept [character]."""

MAX_FILES = 1000
"""Most files that are kept, be they empty."""

PIECE_BYTES = 1000
"""What a piece of a file takes in memory beside its bytes [byte]."""

RESERVED = re.compile(r"^(con|prn|aux|nul|com\d|lpt\d)(\.|$)", re.IGNORECASE)
"""Names that are devices on Windows."""


class UploadRoom:
    """What the uploads of all pages may take together, in memory and on the disk [byte]."""

    def __init__(self, folder: Path, max_bytes: int) -> None:
        self.folder, self.max_bytes = folder, max_bytes
        self._num_pending = 0

    def take(self, num_bytes: int) -> bool:
        """Take room for what is on its way; return False, and take nothing, if there is none."""
        kept = [path.stat().st_size for path in self.folder.iterdir()]
        wanted = sum(kept) + self._num_pending + num_bytes
        if wanted > self.max_bytes or len(kept) >= MAX_FILES:
            return False
        self._num_pending += num_bytes
        return True

    def give_back(self, num_bytes: int) -> None:
        """Give back the room of what has been kept as a file, or will not arrive."""
        self._num_pending -= num_bytes


class BoundedDropper(pn.widgets.FileDropper):
    """A drop zone that holds to the server's limit, whatever the browser sends."""

    def __init__(
        self, room: UploadRoom, when_refused: Callable[[InputError], None], **keywords: Any
    ) -> None:
        super().__init__(
            max_file_size=f"{room.max_bytes // 1_000_000}MB",
            multiple=True,
            chunk_size=2_000_000,
            **keywords,
        )
        self._room = room
        self._when_refused = when_refused
        self._num_pending: dict[str, int] = {}

    def _process_event(self, event: Any) -> None:
        if event.event_name != "upload_event":
            return  # a file that was sent stays: other pages may show it
        name, piece = str(event.data["name"]), event.data.get("data") or b""
        if event.data["chunk"] == 1:
            self._forget(name)
        elif name not in self._file_buffer:
            return  # the rest of a file that was refused
        if not self._room.take(len(piece) + PIECE_BYTES):
            self._forget(name)
            self._when_refused(
                InputError(
                    f"Uploads of all pages exceed {self._room.max_bytes / 1e6:.0f} MB.",
                    remedy="Put the file into the folder that is shown.",
                )
            )
            return
        self._num_pending[name] = self._num_pending.get(name, 0) + len(piece) + PIECE_BYTES
        super()._process_event(event)

    def arrived(self) -> dict[str, bytes | str]:
        """Return the files that have arrived; they are not kept here any longer."""
        files = dict(self.value)
        self.value.clear()
        for name in files:
            self._forget(name)
        return files

    def close(self) -> None:
        """Give back the room of files that will not arrive any more."""
        for name in list(self._num_pending):
            self._forget(name)

    def _forget(self, name: str) -> None:
        self._file_buffer.pop(name, None)
        self._room.give_back(self._num_pending.pop(name, 0))


def safe_name(name: str) -> str:
    """Return a file name that is nothing but a name.

    Folders, control characters, leading dots and everything that is not a letter, a digit or one
    of `._-+@` are dropped or become `_`.

    Raises:
        InputError: If nothing is left, or the ending is that of no bench file.
    """
    last = re.split(r"[/\\]", unicodedata.normalize("NFC", name))[-1]
    kept = "".join(c if c.isalnum() or c in "._-+@" else "_" for c in last).lstrip(".-")
    if not kept or _ending(kept) not in (*ENDINGS, ".toml"):
        raise InputError(
            f"Expected a bench file or a motor file; {last[:60]!r} is neither by its ending.",
            remedy=f"Known are {', '.join(sorted(ENDINGS))}, also with .gz, and .toml.",
        )
    if len(kept) > MAX_NAME:
        tail = kept[len(kept) - 20 :]
        kept = kept[: MAX_NAME - 20] + tail
    return f"_{kept}" if RESERVED.match(kept) else kept


def keep_upload(folder: Path, name: str, content: bytes | str) -> Path:
    """Write an uploaded file, whole or not at all, and never over another one.

    A number stands in its name where that was taken by another content.
    """
    data = content.encode() if isinstance(content, str) else content
    wanted = folder / safe_name(name)
    target, number = wanted, 1
    while target.exists() and target.read_bytes() != data:
        number += 1
        target = wanted.with_name(f"{number}_{wanted.name}")
    folder.mkdir(parents=True, exist_ok=True)
    write_whole(target, data)
    return target
