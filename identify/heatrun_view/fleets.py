"""Fleets that the page can show: the rows of their machines, and what a population says of them."""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from heatrun.errors import InputError

from .folder import Stamp
from .server.confined import is_inside, read_inside

MACHINES, POPULATION, MANIFEST = "machines.parquet", "population.parquet", "manifest.json"
PARTS = "parts"

MAX_BYTES = 500_000_000
"""Largest file of rows that is read [byte]: some 100 000 machines."""

DEEPEST = 3
"""Levels of folders below the one that is shown in which fleets are looked for."""

Row = Mapping[str, Any]


@dataclass(frozen=True)
class Fleet:
    """A folder that `heatrun fleet` wrote or is writing.

    Attributes:
        path: The folder, with links resolved.
        root: The folder that is shown, outside of which nothing is read.
    """

    path: Path
    root: Path

    @property
    def is_whole(self) -> bool:
        """Whether all its machines are there."""
        return (self.path / MACHINES).is_file()

    @property
    def files(self) -> tuple[Path, ...]:
        """The file of its rows, or the parts that are there so far, the youngest last."""
        if self.is_whole:
            return (self.path / MACHINES,)
        parts = (self.path / PARTS).glob("*.parquet")
        return tuple(sorted(parts, key=lambda path: (Stamp.of(path).changed_ns, path)))

    @property
    def populations(self) -> tuple[Path, ...]:
        """Files of populations in the folder that is shown."""
        return tuple(path for path in _found(self.root, POPULATION) if is_inside(self.root, path))

    @property
    def state(self) -> tuple[tuple[Path, Stamp], ...]:
        """What it is read from; another state means another content."""
        return tuple((path, Stamp.of(path)) for path in (*self.files, *self.populations))

    def name(self) -> str:
        """Return the name that the fleet file gives it, that of the folder where there is none."""
        try:
            said = json.loads(read_inside(self.root, self.path / MANIFEST, MAX_BYTES))["fleet"]
        except (InputError, OSError, ValueError, LookupError, TypeError):
            return self.path.name
        return said if isinstance(said, str) and said else self.path.name

    def rows(self) -> tuple[Row, ...]:
        """Return the rows of its machines; of parts of several runs the youngest row of each.

        Raises:
            InputError: If a file is none of heatrun's, or damaged.
        """
        return _rows(self.root, tuple((path, Stamp.of(path)) for path in self.files))

    def sisters(self) -> dict[str, Row]:
        """Return by machine what the populations made of these very rows say of it."""
        if not self.is_whole:
            return {}
        path = self.path / MACHINES
        digest = _digest(self.root, path, Stamp.of(path))
        found: dict[str, Row] = {}
        for population in self.populations:
            if _source(self.root, population.with_name("population.json")) == digest:
                own = _population(self.root, population, Stamp.of(population))
                found |= {row["machine"]: row for row in own if row["status"] == "used"}
        return found


def fleets_under(root: Path) -> list[Fleet]:
    """Return the fleets in a folder and below it, the folder itself first.

    Args:
        root: The folder that is shown, with links resolved.
    """
    folders = [path.parent for path in _found(root, MACHINES)]
    folders += [path.parent.parent for path in _found(root, f"{PARTS}/*.parquet")]
    return [
        Fleet(folder, root)
        for folder in dict.fromkeys(folders)
        if any(is_inside(root, path) for path in Fleet(folder, root).files)
    ]


def _found(root: Path, pattern: str) -> list[Path]:
    return [
        path for depth in range(DEEPEST + 1) for path in sorted(root.glob("*/" * depth + pattern))
    ]


@lru_cache(maxsize=4)
def _rows(root: Path, files: tuple[tuple[Path, Stamp], ...]) -> tuple[Row, ...]:
    from heatrun_fleet.parts import read_part  # needs pyarrow

    rows: list[Row] = []
    for path, _ in files:
        try:
            rows += read_part(read_inside(root, path, MAX_BYTES)).to_pylist()
        except InputError:
            raise
        except (OSError, ValueError) as error:  # pyarrow's errors are kinds of these
            raise InputError(
                f"Expected the rows of a fleet, they could not be read ({error}).",
                where=str(path),
                remedy="Run `heatrun fleet` again: what is whole is kept, the rest is worked out.",
            ) from None
    if len(files) == 1:
        return tuple(rows)
    by_name = {row["machine"]: row for row in rows}
    return tuple(by_name[name] for name in sorted(by_name))


@lru_cache(maxsize=4)
def _digest(root: Path, path: Path, stamp: Stamp) -> str:
    return hashlib.sha256(read_inside(root, path, MAX_BYTES)).hexdigest()


def _source(root: Path, path: Path) -> str | None:
    """Return the SHA-256 of the rows that a population was made of; None where it does not say."""
    try:
        return json.loads(read_inside(root, path, MAX_BYTES))["source"][MACHINES]
    except (InputError, OSError, ValueError, LookupError, TypeError):
        return None


@lru_cache(maxsize=16)
def _population(root: Path, path: Path, stamp: Stamp) -> tuple[Row, ...]:
    from pyarrow.parquet import read_table

    from heatrun_fleet.population.table import schema

    try:
        table = read_table(io.BytesIO(read_inside(root, path, MAX_BYTES)))
    except (InputError, OSError, ValueError):
        return ()  # the fleet is shown without it
    return tuple(table.to_pylist()) if table.schema == schema() else ()
