"""The folder that the live view shows: what is in it, and nothing outside it."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from io import BufferedReader
from pathlib import Path

from heatrun.bench.own_files import MACHINES, MOST_BYTES, SIMULATION, own_file
from heatrun.errors import InputError
from heatrun.runs.run_folder import MANIFEST

from .server.confined import is_inside, open_inside, outside

SUFFIXES = frozenset(
    (
        *(".csv", ".tsv", ".txt", ".dat", ".asc", ".mat", ".parquet", ".mf4", ".mdf", ".tdms"),
        *(".xlsx", ".xlsm"),
    )
)
"""Endings of the files that are offered as tests, also with .gz behind them."""

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
        """Return the stamp of a file; that of nothing (-1, -1) where there is no file."""
        try:
            status = path.stat()
        except OSError:
            return cls(-1, -1)
        return cls(status.st_size, status.st_mtime_ns)


@dataclass(frozen=True)
class Listing:
    """What a folder holds, by name relative to it.

    Attributes:
        tests: Bench files.
        simulated: Virtual records that heatrun has simulated, to be looked at beside the tests.
        motors: Motor files: TOML with a table `[motor]`.
        is_cut: Whether there was more than is looked at.
        num_own: Other files that heatrun itself has written, which are not listed.
    """

    tests: tuple[str, ...]
    simulated: tuple[str, ...]
    motors: tuple[str, ...]
    is_cut: bool
    num_own: int = 0


class Folder:
    """A folder of tests and motor files.

    Attributes:
        root: The folder, with links resolved.
    """

    def __init__(self, root: Path) -> None:
        if not root.is_dir():
            raise InputError(
                "Expected a folder with tests and a motor file, and there is none.",
                where=str(root),
                remedy="Name an existing folder: heatrun view DIR.",
            )
        self.root = root.resolve()

    def path(self, name: str) -> Path:
        """Return the path of a file in the folder.

        Args:
            name: Relative to the folder.

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
            if _ending(path) in SUFFIXES:
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
            names.sort(key=_nearest)
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


def _nearest(name: str) -> tuple[int, str]:
    """Order by depth, then by name: the files of the folder itself come first."""
    return name.count("/"), name


def _ending(path: Path) -> str:
    name = path.name.lower().removesuffix(".gz")
    return Path(name).suffix
