"""Files that are there whole or not at all, whatever happens to the process that writes them.

Steps that belong together are not torn by Ctrl-C or by the end of the session, and a second result
does not replace a first. Further down stand texts without the folders of their files, who opens
what readers read, and the time that is written into files.

Files that belong together, in a folder that may hold others, all appear, or none.
They are written into a folder aside, `.NAME.XXXX.heatrun.partial`. When everything is in it, it
becomes `.NAME.XXXX.heatrun.ready`, in one step: from then on the set is there, and its files take
their places by one rename each, PDFs last. A kill before that step leaves what was there before; a
kill after it is brought to its end by the next start in the folder.
"""

from __future__ import annotations

import datetime
import errno
import os
import re
import shlex
import shutil
import signal
import tempfile
import threading
import unicodedata
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from itertools import count
from pathlib import Path, PurePath
from typing import BinaryIO

from ..errors import InputError, UsageError
from .caches import FolderLock

SIGNALS = tuple(getattr(signal, n) for n in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, n))


@contextmanager
def undisturbed() -> Iterator[None]:
    """Put off signals that end the process until the block is over; for milliseconds of work.

    Not by a mask, which holds for one thread only: the system then gives the signal to another.
    What is ignored stays ignored, and threads other than the main one change nothing.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[int] = []
    before = {}
    for number in SIGNALS:
        handler = signal.getsignal(number)
        if handler not in (None, signal.SIG_IGN):  # None: set by code that is not Python
            before[number] = handler
            signal.signal(number, lambda sent, frame: came.append(sent))
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        for number in came:
            signal.raise_signal(number)


PARTIAL = ".partial"
"""End of the name of what is being written."""


def write_whole(path: Path, content: bytes) -> None:
    """Write a file so that a reader sees all of it or none, even after a kill.

    Raises:
        OSError: If it cannot be written; no part of it is left then, and what it held before stays.
    """
    with whole(path) as partial, partial.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


@contextmanager
def whole(path: Path) -> Iterator[Path]:
    """Give a name to write a file under, which becomes `path` once that has succeeded."""
    partial = path.with_name(f".{path.name}.{os.getpid()}{PARTIAL}")
    try:
        yield partial
        partial.replace(path)
    except BaseException:
        partial.unlink(missing_ok=True)
        raise


@contextmanager
def writable(what: str, place: Path) -> Iterator[None]:
    """Turn what the system says of a place that cannot be written to into an error for the user.

    Raises:
        InputError: Instead of an OSError.
    """
    try:
        yield
    except OSError as error:
        raise InputError(
            f"{what} cannot be written: {error.strerror}.",
            where=str(place),
            remedy="Choose a writable folder with --out.",
        ) from error


def drop_partials(folder: Path) -> None:
    """Remove the pieces of files that killed processes left in a folder, which no other writes to,
    and below it.
    """
    for piece in folder.rglob(f".*{PARTIAL}"):
        if piece.is_dir():
            shutil.rmtree(piece)
        else:
            piece.unlink()


LONGEST_NAME = 80
"""Letters of a folder's name that is made of others."""


def folder_name(words: str) -> str:
    """Return words as the name of a folder: small letters without their marks, digits and dashes.

    What is no Latin letter is left out, so that nothing may be left.
    """
    plain = unicodedata.normalize("NFKD", words.casefold())
    kept = (c for c in plain if not unicodedata.combining(c))
    text = "".join(c if c.isalnum() and c.isascii() else "-" for c in kept)
    return re.sub("-+", "-", text).strip("-")[:LONGEST_NAME]


def numbered(path: Path, next_to: Path | None = None) -> Iterator[Path]:
    """Give a path, then the same with `-2`, `-3` and so on behind its stem, or that of another.

    It is a file, or a folder without a point in its name.
    """
    yield path
    base = next_to or path
    for number in count(2):
        yield base.with_name(f"{base.stem}-{number}{base.suffix}")


def free_name(path: Path) -> Path:
    """Return the first of `numbered` that nothing stands under."""
    return next(place for place in numbered(path) if not place.exists())


def refuse_replacing(path: Path, what: str) -> None:
    """Refuse to replace a result that stands where another one was asked to go.

    Raises:
        InputError: If something stands there.
    """
    if path.exists():
        raise InputError(
            f"{path} exists and holds {what}; it is left as it is.",
            remedy="Choose another --out, or pass --force to replace it.",
        )


def is_other(path: Path, content: bytes) -> bool:
    """Return whether a file is there and holds something else than it is to hold."""
    try:
        return path.read_bytes() != content
    except OSError:
        return False  # it is not there, or writing fails with its own words


ABSOLUTE = re.compile(r"""(?<![^\s'"`(=+,:;])(?:[A-Za-z]:)?[/\\](?:[^\s/\\'"`]+[/\\])+""")
"""Folders in front of a name, from the root on; a unit such as J/K has none."""

FOLDERS_OF_A_WORD = re.compile(r"[^+=]*[/\\](?=[^/\\])")
"""Those in a word of a command, which may join two files by + or give an option a value by =."""


def without_folders(text: str, paths: Iterable[str] = ()) -> str:
    """Return a text in which files stand without their folders, also relative paths and such with
    spaces, if they are given.
    """
    for path in sorted(set(paths), key=len, reverse=True):
        name = PurePath(path).name
        if name and name != path:
            text = text.replace(path, name)
    return ABSOLUTE.sub("", text)


def command_without_folders(command: str) -> str:
    """Return a command line whose files stand without their folders."""
    try:
        words = shlex.split(command)
    except ValueError:  # an odd apostrophe, in a run of an earlier version
        words = command.split(" ")
    return shlex.join(FOLDERS_OF_A_WORD.sub("", word) for word in words)


Opener = Callable[[Path], BinaryIO]
"""Opens a file for reading, or raises OSError or InputError."""

_opener: ContextVar[Opener | None] = ContextVar("opener", default=None)


def opener_of_this_thread() -> Opener | None:
    """Return what opens files here; None where a path is opened as it is."""
    return _opener.get()


@contextmanager
def opening_by(opener: Opener) -> Iterator[None]:
    """Let the readers of this thread open files by a function, for the time of the context."""
    mark = _opener.set(opener)
    try:
        yield
    finally:
        _opener.reset(mark)


VARIABLE = "SOURCE_DATE_EPOCH"

NO_DATE = datetime.datetime(1980, 1, 1, tzinfo=datetime.UTC)
"""What stands where a format needs a date and none is given: the first that ZIP knows."""


def stated_moment() -> datetime.datetime | None:
    """Return the moment of SOURCE_DATE_EPOCH in UTC, or None where it is not set.

    The same command with the same seed writes the same bytes. Only the manifest of a run says when
    it was made; with SOURCE_DATE_EPOCH (seconds since 1970, of the Reproducible Builds project) it
    too is the same every time. Other files carry that date where their format wants one, or none.

    Raises:
        UsageError: If it is no number of seconds.
    """
    text = os.environ.get(VARIABLE)
    if not text:
        return None
    try:
        if not (text.isascii() and text.isdigit()):
            raise ValueError
        return datetime.datetime.fromtimestamp(int(text), tz=datetime.UTC)
    except (ValueError, OverflowError, OSError) as error:
        raise UsageError(
            f"the environment variable {VARIABLE} is {text[:40]!r}; expected whole seconds since "
            "1970-01-01, such as 1700000000. Correct it, or unset it."
        ) from error


def check_stated_moment() -> None:
    """Refuse a wrong SOURCE_DATE_EPOCH before any work, and drop an empty one: NumPy fails on it.

    Raises:
        UsageError: As `stated_moment`.
    """
    if stated_moment() is None:
        os.environ.pop(VARIABLE, None)


def moment() -> datetime.datetime:
    """Return the moment of a run in UTC: the stated one, or now."""
    return stated_moment() or datetime.datetime.now(datetime.UTC)


ASIDE = f".heatrun{PARTIAL}"
"""End of the name of a folder that a set is written into."""

READY = ".heatrun.ready"
"""End of its name once the set is complete."""


@dataclass(frozen=True)
class FileSet:
    """A set of files on its way."""

    folder: Path  # Where the files will be.
    name: str  # Of the set, as it was chosen.
    aside: Path  # Where they are written; subfolders are taken along.
    lock: FolderLock  # Held on `aside` while this process lives: how others see that it does.

    @classmethod
    def begin(cls, folder: Path, name: str | Callable[[], str]) -> FileSet:
        """Make the folder aside, after what killed processes left was tidied up.

        Args:
            folder: Where the files will be; made if it is not there.
            name: Of the set, without slashes; or what chooses it while no other process begins
                or completes a set in this folder.

        Raises:
            OSError: If the folder cannot be written to.
        """
        with _alone_in(folder):
            chosen = name if isinstance(name, str) else name()
            place = tempfile.mkdtemp(prefix=f".{chosen}.", suffix=ASIDE, dir=folder)
            return cls(folder, chosen, Path(place), FolderLock.take(Path(place)))

    def finish(self) -> list[Path]:
        """Let the files take their places; return where they are now."""
        for path in self.aside.rglob("*"):
            place = self.folder / path.relative_to(self.aside)
            if place.is_dir() and not path.is_dir():
                raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(place))
            _to_disk(path)
        _to_disk(self.aside)
        with _alone_in(self.folder), undisturbed():
            ready = self.aside.with_name(self.aside.name.removesuffix(ASIDE) + READY)
            self.aside.replace(ready)
            placed = _take_places(ready, self.folder)
        self.lock.release()
        return placed

    def drop(self) -> None:
        """Throw away what was written, unless the set is complete."""
        shutil.rmtree(self.aside, ignore_errors=True)
        self.lock.release()


@contextmanager
def together(folder: Path, name: str | Callable[[], str]) -> Iterator[FileSet]:
    """Give a set as `FileSet.begin`, whose files are written into its `aside`; they appear in
    `folder` at the end.

    Raises:
        OSError: If a file cannot be written; none of them is there then.
    """
    files = FileSet.begin(folder, name)
    try:
        yield files
        files.finish()
    except BaseException:
        files.drop()
        raise


def names_begun(folder: Path, begin: str) -> list[str]:
    """Return the names of sets that living processes are writing; for what chooses a name."""
    names = [path.name for path in folder.iterdir() if path.name.endswith(ASIDE)]
    return [n[1 : -len(ASIDE)].rpartition(".")[0] for n in names if n.startswith(f".{begin}")]


def is_aside(path: Path) -> bool:
    """Whether a path lies in the folder of a set on its way."""
    return any(part.endswith((ASIDE, READY)) for part in path.parts)


@contextmanager
def _alone_in(folder: Path) -> Iterator[None]:
    """Hold the folder, for milliseconds, with nothing in it that a killed process left."""
    lock = FolderLock.take(folder, waits=True)
    try:
        for path in sorted(folder.iterdir()):
            if not path.name.startswith(".") or path.is_symlink():
                continue
            if path.name.endswith(READY):
                with undisturbed():
                    _take_places(path, folder)
            elif path.name.endswith(ASIDE) and FolderLock.is_free(path):
                shutil.rmtree(path, ignore_errors=True)
        yield
    finally:
        lock.release()


def _take_places(ready: Path, folder: Path) -> list[Path]:
    """Rename the files of a complete set to their places and remove its folder."""
    files = [path.relative_to(ready) for path in ready.rglob("*") if not path.is_dir()]
    # whoever waits for the document finds the rest beside it
    files.sort(key=lambda name: (name.suffix == ".pdf", name))
    for name in files:
        target = folder / name
        target.parent.mkdir(parents=True, exist_ok=True)
        (ready / name).replace(target)
    _to_disk(folder)
    shutil.rmtree(ready)
    return [folder / name for name in files]


def _to_disk(path: Path) -> None:
    """Have the system write a file or folder out, where it can."""
    if os.name != "posix":
        return
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
