"""One process at a time in a folder: the hold ends with the process, however that ends."""

from __future__ import annotations

import hashlib
import os
import tempfile
import weakref
from collections.abc import Callable
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
        """Make the folder if it is not there and lock it.

        Args:
            folder: The folder; its parents are made too.
            waits: Whether to wait until another process has let it go.

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
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | (0 if waits else fcntl.LOCK_NB))
        if _is_at(descriptor, folder):
            return lambda: os.close(descriptor)
    except BlockingIOError as error:
        os.close(descriptor)
        raise _held(folder) from error
    except BaseException:
        os.close(descriptor)
        raise
    os.close(descriptor)
    return None


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
