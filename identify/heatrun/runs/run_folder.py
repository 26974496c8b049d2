"""The run folder: the result as files, there as a whole or not at all, resumable after a kill.

A run works in `NAME.partial` beside its destination, where its checkpoints lie; the folder takes
its name in one step when everything is in it. The same command started again finds the partial
folder of the same inputs and goes on. Of its own files a run keeps paths and digests, no signals.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
import re
import shlex
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..io.caches import FolderLock
from ..io.open_file import digest
from ..io.whole_files import (
    PARTIAL,
    drop_partials,
    folder_name,
    is_aside,
    numbered,
    refuse_replacing,
    undisturbed,
    writable,
    write_whole,
)
from ..record.motor import Motor
from ..record.record import Record
from ..record.stretch import split_stretch
from ..results.values import to_json


@dataclass(frozen=True)
class SourceFile:
    """A file that a run was made of."""

    path: str  # As it was given.
    sha256: str  # Its digest then.


def as_named(path: str, test: str, command: str) -> str:
    """Return a path with the sheet and the sampling rate that the run's command gave it, if it did.

    Args:
        path: The file.
        test: Name of the test; it tells sheets of one workbook apart.
        command: Of the run.
    """
    try:
        words = shlex.split(command)
    except ValueError:
        return path
    form = re.compile(re.escape(path) + r"(?:#(?P<sheet>.+?))?(?:@[0-9.]+\s*Hz)?", re.DOTALL)
    found = [
        named
        for word in words
        for part in _parts(word)
        if part != path and (named := form.fullmatch(part))
    ]
    of_test = [one for one in found if one["sheet"] and test.endswith(f"_{one['sheet']}")]
    return next((one[0] for one in (*of_test, *found)), path)


def _parts(word: str) -> list[str]:
    """Return a word of the command line and its files, without the stretch behind them."""
    test, _ = split_stretch(word)
    return [test, *test.split("+")]


def found_from(path: str, run: Path) -> str:
    """Return a path as it is where it leads to a file, else from the nearest folder around the run
    that it leads to one from.
    """
    if Path(path).is_file() or Path(path).is_absolute():
        return path
    around = (str(folder / path) for folder in run.resolve().parents if (folder / path).is_file())
    return next(around, path)


def refuse_changed(file: SourceFile, run: Path, kind: str) -> None:
    """Refuse a file that is not what it was when the run was made.

    Raises:
        InputError: If it is gone or has changed.
    """
    path, expected = file.path, file.sha256
    try:
        now = digest(path)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(
            f"the {kind} {path} of this run cannot be read ({reason}); the run keeps its path "
            "as it was given, and no signals.",
            where=str(run),
            remedy="Start the command in the folder that the run was started in, "
            "or put the file back.",
        ) from error
    if now != expected:
        raise InputError(
            f"the {kind} {path} has changed since the run: SHA-256 {expected[:12]}… then, "
            f"{now[:12]}… now.",
            where=str(run),
            remedy="Put the file of the run back, or calibrate again.",
        )


def default_folder(motor: Motor, test: Record, order: str) -> Path:
    """Return where a run goes if no folder is given: named after motor and first test, once where
    they have one name.
    """
    words = "-".join(dict.fromkeys((motor.name, test.name, order)))
    return Path("results") / "runs" / folder_name(words)


def refuse_unwritable(path: Path) -> None:
    """Raise an error if a folder's parent is a file.

    Raises:
        InputError: With what to do.
    """
    for parent in path.parents:
        if parent.is_file():
            raise InputError(
                f"{parent} is a file, expected a folder.", remedy="Choose another --out."
            )


MANIFEST = "manifest.json"
CHECKPOINTS = "checkpoints"
IDENTITY = "identity"
"""File with the digest of what an unfinished run is about."""

PACKAGES = ("heatrun", "jax", "optimistix", "diffrax", "emcee", "numpy", "pandas", "arviz")


@dataclass(frozen=True)
class RunFolder:
    """A run on its way to a folder."""

    path: Path  # Where it will be.
    partial: Path  # Where it is until it is whole.
    note: str = ""  # What became of an earlier attempt at this place; empty if there was none.
    lock: FolderLock | None = None  # Held on `partial` while this process works in it.
    identity: str = ""  # Digest of what makes the result what it is, for the manifest.

    @classmethod
    def begin(
        cls,
        path: Path,
        identity: Mapping[str, Any],
        *,
        further: Sequence[str] = (),
        is_replacing: bool = False,
    ) -> RunFolder:
        """Make or take up the partial folder of a run.

        Args:
            path: Destination; an earlier run of the same there is replaced in the end, anything
                else is not.
            identity: What makes the run what it is: inputs with digests, settings, seed.
            further: What else stands in the result, and does not matter to an unfinished run.
            is_replacing: Whether any earlier run is replaced.

        Raises:
            InputError: If the destination is no run or holds another one, cannot be written to,
                or another process is writing it.
        """
        digest = _digest(identity)
        partial = path.with_name(path.name + PARTIAL)
        with writable("the run folder", path.parent):
            lock = FolderLock.take(partial)
            _settle(path)
            if path.exists() and not (path / MANIFEST).is_file():
                _drop_if_empty(partial)
                raise InputError(
                    f"{path} exists and is not a run of heatrun (it has no {MANIFEST}).",
                    remedy="Choose another --out.",
                )
            whole = _digest([digest, *further])
            if not is_replacing and _holds_another(path, whole):
                _drop_if_empty(partial)
                refuse_replacing(path, "another run")
            note = _make_ready(partial, digest)
        return cls(path, partial, note, lock, whole)

    @property
    def checkpoints(self) -> Path:
        """Folder of the sampler's checkpoints."""
        return self.partial / CHECKPOINTS

    @contextmanager
    def dropped_if_refused(self) -> Iterator[None]:
        """Leave no folder behind where the input is refused before anything was worked out."""
        try:
            yield
        except InputError:
            if {entry.name for entry in self.partial.iterdir()} <= {IDENTITY}:
                (self.partial / IDENTITY).unlink(missing_ok=True)
                _drop_if_empty(self.partial)
            raise

    def write_json(self, name: str, content: Any) -> None:
        """Write a JSON file, whole or not at all; content as `heatrun.results.to_json`."""
        write_whole(self.partial / name, (to_json(content) + "\n").encode())

    def finish(self, manifest: Mapping[str, Any]) -> Path:
        """Write the manifest, give the folder its name and drop the checkpoints.

        In this order, a kill in between costs no work: without a manifest the next start goes on
        from the checkpoints, and under its name the folder is whole.
        """
        own = {**manifest, "identity": self.identity, "files": listing(self.partial)}
        self.write_json(MANIFEST, own)
        with undisturbed():
            if self.path.exists():
                self.path.replace(_replaced(self.path))
            self.partial.replace(self.path)
        _settle(self.path)
        if self.lock is not None:
            self.lock.release()
        return self.path


def listing(folder: Path) -> dict[str, str]:
    """Return the SHA-256 digests of the files of a run by their names in its folder."""
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    names = {str(path.relative_to(folder)): path for path in files}
    return {
        name: hashlib.sha256(path.read_bytes()).hexdigest()
        for name, path in names.items()
        if name not in (MANIFEST, IDENTITY)
        and not name.startswith(f"{CHECKPOINTS}{os.sep}")
        and not path.name.endswith(PARTIAL)
        and not is_aside(path.relative_to(folder))
    }


def free_place(path: Path, identity: Mapping[str, Any], further: Sequence[str] = ()) -> Path:
    """Return a path, or the first of its numbers, that holds nothing or a run of the same."""
    whole = _digest([_digest(identity), *further])
    return next(place for place in numbered(path) if not _holds_another(place, whole))


def _digest(content: Any) -> str:
    return hashlib.sha256(to_json(content).encode()).hexdigest()


def _holds_another(path: Path, identity: str) -> bool:
    """Whether something stands at a path that is not the run of an identity."""
    if not path.exists():
        return False
    try:
        return json.loads((path / MANIFEST).read_bytes()).get("identity") != identity
    except (OSError, ValueError, AttributeError, RecursionError):
        return True


def _replaced(path: Path) -> Path:
    """Return where an earlier run waits while a new one takes its name."""
    return path.with_name(f".{path.name}.replaced")


def _settle(path: Path) -> None:
    """Bring to its end what a kill within `RunFolder.finish` left."""
    old = _replaced(path)
    if (path / MANIFEST).is_file():
        shutil.rmtree(path / CHECKPOINTS, ignore_errors=True)
        (path / IDENTITY).unlink(missing_ok=True)
        shutil.rmtree(old, ignore_errors=True)
    elif (old / MANIFEST).is_file() and not path.exists():
        old.replace(path)


def _make_ready(partial: Path, digest: str) -> str:
    """Mark a folder as the place of a run, emptied if it held another; return what was there."""
    mark = partial / IDENTITY
    drop_partials(partial)
    entries = list(partial.iterdir())
    if entries and not mark.is_file():
        raise InputError(
            f"{partial} holds something that is no unfinished run of heatrun.",
            remedy="Move it away, or choose another --out.",
        )
    if not entries:
        note = ""
    elif mark.read_bytes() == digest.encode():
        note = f"taking up the unfinished run in {partial}"
        (partial / MANIFEST).unlink(missing_ok=True)
    else:
        others = "its inputs, settings or versions were others"
        note = f"dropping the unfinished run in {partial}: {others}"
        # the mark goes last: what a kill leaves is still known as ours
        for entry in entries:
            if entry.is_dir():
                shutil.rmtree(entry)
            elif entry != mark:
                entry.unlink()
    write_whole(mark, digest.encode())
    return note


def _drop_if_empty(folder: Path) -> None:
    with suppress(OSError):
        folder.rmdir()


def environment() -> dict[str, Any]:
    """Return versions of what a result depends on."""
    return {
        "python": platform.python_version(),
        "machine": platform.machine(),
        "packages": {name: version(name) for name in PACKAGES},
    }


def read_listed(run: Path, name: str, read: Callable[[Path], bytes] = Path.read_bytes) -> bytes:
    """Return a file of a run, which is what the manifest says.

    Raises:
        InputError: If the folder is no run, or the file is missing, damaged or was changed.
    """
    if not (run / MANIFEST).is_file() or not (run / "fit.json").is_file():
        raise InputError(
            f"{run} is not a run folder: it holds no {MANIFEST} and fit.json.",
            remedy="Pass the folder that `heatrun calibrate --out` wrote.",
        )
    try:
        listed = json.loads(read(run / MANIFEST))["files"][name]
        content = read(run / name)
    except (OSError, ValueError, LookupError, TypeError, RecursionError) as error:
        raise InputError(
            f"{name} or the {MANIFEST} that lists it cannot be read "
            f"({type(error).__name__}: {error}).",
            where=str(run),
            remedy="Calibrate again.",
        ) from error
    if hashlib.sha256(content).hexdigest() != listed:
        raise InputError(
            f"{name} is not the file that the run wrote: its SHA-256 is not that in {MANIFEST}.",
            where=str(run),
            remedy="Bring the file back, or calibrate again.",
        )
    return content


def listed_anew(run: Path, written: Path) -> bytes:
    """Return the manifest of a run as it is once the files of a folder are in the run too."""
    manifest = json.loads((run / MANIFEST).read_bytes())
    files = dict(sorted({**manifest["files"], **listing(written)}.items()))
    return (to_json({**manifest, "files": files}) + "\n").encode()
