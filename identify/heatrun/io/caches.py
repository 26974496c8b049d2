"""Folders that hold what commands keep between two runs, and the lock of a folder.

Compiled programs and lists of fonts are kept; none of it is needed. A folder that cannot be written
to is a note, and that of the programs stays below a bound. A lock keeps a folder to one process at
a time and ends with the process, however that ends.
"""

from __future__ import annotations

import atexit
import hashlib
import os
import shutil
import sys
import tempfile
import weakref
from collections.abc import Callable
from contextlib import ExitStack, suppress
from pathlib import Path

from ..errors import InputError

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

LOCKS = "heatrun-locks"
"""Folder of the lock files among the temporary files of the user, where one is needed."""


class FolderLock:
    """A folder that this process alone works in.

    On POSIX systems the folder itself is locked and not a file in it: nothing is left behind by a
    kill, and the lock stays with the folder when that takes another name. Windows cannot lock a
    folder, and renames none in which a file is open. There a file among the user's temporary files
    stands for the path of the folder, by the library filelock: it keeps the processes of one user
    on one machine apart.
    """

    def __init__(self, let_go: Callable[[], None]) -> None:
        self._release = weakref.finalize(self, let_go)

    @classmethod
    def take(cls, folder: Path, *, waits: bool = False) -> FolderLock:
        """Make the folder and its parents if they are not there and lock it.

        Raises:
            InputError: If another process works in it, unless this one waits.
            OSError: If it cannot be made or opened.
        """
        while True:
            folder.mkdir(parents=True, exist_ok=True)
            let_go = _hold_path(folder, waits) if fcntl is None else _hold_folder(folder, waits)
            if let_go is not None:
                return cls(let_go)

    @classmethod
    def is_free(cls, folder: Path) -> bool:
        """Whether no living process works in an existing folder."""
        if not folder.is_dir():
            return False
        try:
            cls.take(folder).release()
        except InputError:
            return False
        return True

    def release(self) -> None:
        """Let the folder go; nothing happens if it was let go before."""
        self._release()


def _hold_folder(folder: Path, waits: bool) -> Callable[[], None] | None:
    """Lock a folder and return what lets it go; None if it took another name meanwhile."""
    assert fcntl is not None  # as `FolderLock.take` saw
    with ExitStack() as held:
        descriptor = os.open(folder, os.O_RDONLY)
        held.callback(os.close, descriptor)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | (0 if waits else fcntl.LOCK_NB))
        except BlockingIOError as error:
            raise _held(folder) from error
        return held.pop_all().close if _is_at(descriptor, folder) else None


def _hold_path(folder: Path, waits: bool) -> Callable[[], None]:
    """Lock the file that stands for a folder's path and return what lets it go."""
    import filelock

    path = os.path.normcase(folder.resolve())
    locks = Path(tempfile.gettempdir()) / LOCKS
    locks.mkdir(exist_ok=True)
    name = f"{hashlib.sha256(path.encode()).hexdigest()[:32]}.lock"
    lock = filelock.FileLock(locks / name, thread_local=False)
    try:
        lock.acquire(blocking=waits)
    except filelock.Timeout as error:
        raise _held(folder) from error
    return lambda: lock.release(force=True)


def _held(folder: Path) -> InputError:
    return InputError(
        "another process is writing this run.",
        where=str(folder),
        remedy="Wait until it is done, or choose another --out.",
    )


def _is_at(descriptor: int, folder: Path) -> bool:
    """Whether the folder was not renamed or removed between its opening and its locking."""
    try:
        return os.path.samestat(os.fstat(descriptor), folder.stat())
    except FileNotFoundError:
        return False


PROGRAMS_FOLDER = "JAX_COMPILATION_CACHE_DIR"
"""Variable of the environment that names the folder of compiled programs; without it none is kept,
beyond the process."""

PROGRAM = ".program"
"""Ending of a compiled program that is kept."""

COMPILATIONS = "heatrun/programs"
FOLDERS = (COMPILATIONS, "matplotlib", "arviz")
"""What is made below the user's cache folder, by heatrun and by packages that it loads."""

MOST_BYTES = 256_000_000
"""About a thousand compilations; a command adds up to some 20 MB, the next start clears away."""

IN_PLACE = ".heatrun-cache"
"""End of the name of a folder that stands in for a cache folder while one process runs."""


def use_caches(say: Callable[[str], None]) -> None:
    """Choose the folders of the caches; for commands, before JAX and matplotlib are loaded.

    The second run of a command then needs a third of the processor time of the first. The folder
    of programs is the user's to choose by JAX_COMPILATION_CACHE_DIR, and is then left alone. Where
    there is no cache, it is said why.
    """
    base = Path(os.environ.get("XDG_CACHE_HOME") or Path("~").expanduser() / ".cache")
    refused = next((why for name in FOLDERS if (why := _refusal(base / name))), "")
    if refused:
        say(f"{refused}: this run does without the cache and takes longer. Set XDG_CACHE_HOME to "
            "a writable folder to keep one.")  # fmt: skip
        stands_in = _stand_in()
        os.environ["XDG_CACHE_HOME"] = str(stands_in)
        os.environ.setdefault("MPLCONFIGDIR", str(stands_in / "matplotlib"))
        return
    ours = str(base / COMPILATIONS)
    if os.environ.setdefault(PROGRAMS_FOLDER, ours) == ours:
        with suppress(OSError):
            keep_below(Path(ours), MOST_BYTES)


def has_programs() -> bool:
    """Whether any program is kept, so that not all is to be compiled."""
    folder = os.environ.get(PROGRAMS_FOLDER)
    return folder is not None and any(Path(folder).glob(f"*{PROGRAM}"))


def keep_below(folder: Path, most_bytes: int) -> None:
    """Remove the programs that were used longest ago until the others take so much [byte]."""
    entries = []
    for path in folder.glob(f"*{PROGRAM}"):
        with suppress(FileNotFoundError):  # another process clears away too
            status = path.stat()
            entries.append((max(status.st_atime_ns, status.st_mtime_ns), status.st_size, path))
    total = sum(size for _, size, _ in entries)
    for _, size, path in sorted(entries):
        if total <= most_bytes:
            return
        path.unlink(missing_ok=True)
        total -= size


def _refusal(folder: Path) -> str:
    """Return why a folder cannot be written to; empty if it can."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        return f"{folder} cannot be made ({error.strerror})"
    return "" if os.access(folder, os.W_OK | os.X_OK) else f"{folder} cannot be written to"


def _stand_in() -> Path:
    """Return an empty folder that goes with the process; those of killed ones go now."""
    for left in Path(tempfile.gettempdir()).glob(f"*{IN_PLACE}"):
        with suppress(OSError):
            is_mine = sys.platform == "win32" or left.lstat().st_uid == os.getuid()
            if is_mine and not left.is_symlink() and FolderLock.is_free(left):
                shutil.rmtree(left, ignore_errors=True)
    folder = Path(tempfile.mkdtemp(suffix=IN_PLACE))
    lock = FolderLock.take(folder)

    def clear() -> None:
        lock.release()
        shutil.rmtree(folder, ignore_errors=True)

    atexit.register(clear)
    return folder
