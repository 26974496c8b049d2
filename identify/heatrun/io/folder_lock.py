"""One process at a time in a folder: the hold ends with the process, however that ends."""

from __future__ import annotations

import os
import weakref
from pathlib import Path

from ..errors import InputError

try:
    import fcntl
except ImportError:  # not a POSIX system: there, no folder can be locked
    fcntl = None  # type: ignore[assignment]


class FolderLock:
    """A folder that this process alone works in.

    The folder itself is locked and not a file in it: nothing is left behind by a kill, and the
    lock stays with the folder when that takes another name.
    """

    def __init__(self, descriptor: int | None) -> None:
        self._release = None if descriptor is None else weakref.finalize(self, os.close, descriptor)

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
            if fcntl is None:
                return cls(None)
            descriptor = os.open(folder, os.O_RDONLY)
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | (0 if waits else fcntl.LOCK_NB))
                if _is_at(descriptor, folder):
                    return cls(descriptor)
            except BlockingIOError as error:
                os.close(descriptor)
                raise InputError(
                    "another process is writing this run.",
                    where=str(folder),
                    remedy="Wait until it is done, or choose another --out.",
                ) from error
            except BaseException:
                os.close(descriptor)
                raise
            os.close(descriptor)

    @classmethod
    def is_free(cls, folder: Path) -> bool:
        """Whether no living process works in an existing folder; False where nobody can know."""
        if fcntl is None or not folder.is_dir():
            return False
        try:
            cls.take(folder).release()
        except InputError:
            return False
        return True

    def release(self) -> None:
        """Let the folder go; nothing happens if it was let go before."""
        if self._release is not None:
            self._release()


def _is_at(descriptor: int, folder: Path) -> bool:
    """Whether the folder was not renamed or removed between its opening and its locking."""
    try:
        return os.path.samestat(os.fstat(descriptor), folder.stat())
    except FileNotFoundError:
        return False
