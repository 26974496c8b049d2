"""Files that belong together, in a folder that may hold others: all of them appear, or none.

They are written into a folder aside, `.NAME.XXXX.heatrun.partial`. When everything is in it, it
becomes `.NAME.XXXX.heatrun.ready`, in one step: from then on the set is there, and its files take
their places by one rename each, PDFs last. A kill before that step leaves what was there before; a
kill after it is brought to its end by the next start in the folder.
"""

from __future__ import annotations

import errno
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from .caches import FolderLock
from .whole_files import PARTIAL, undisturbed

ASIDE = f".heatrun{PARTIAL}"
"""End of the name of a folder that a set is written into."""

READY = ".heatrun.ready"
"""End of its name once the set is complete."""


@dataclass(frozen=True)
class FileSet:
    """A set of files on its way.

    Attributes:
        folder: Where the files will be.
        name: Of the set, as it was chosen.
        aside: Where they are written; subfolders are taken along.
        lock: Held on `aside` while this process lives: how others see that it does.
    """

    folder: Path
    name: str
    aside: Path
    lock: FolderLock

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
    """Give a set whose files are written into its `aside`; they appear in `folder` at the end.

    Args:
        folder: Where the files will be; made if it is not there.
        name: As `FileSet.begin`.

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
    """Return the names of sets that living processes are writing; for what chooses a name.

    Args:
        folder: Where the sets will be.
        begin: Beginning of the names.
    """
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
