"""Batches of machines: what a worker is given, and the name that stands for all of it."""

from __future__ import annotations

import hashlib
import os
import platform
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

from heatrun.errors import InputError
from heatrun.io.open_file import digest
from heatrun.model.network_form import NetworkForm
from heatrun.model.network_text import network_text
from heatrun.readers.joined import files_of
from heatrun.record.record import Finding
from heatrun.results.json_text import to_json

from .entries import Entry
from .fleet_file import Fleet
from .rows import FORMAT

PACKAGES = ("heatrun", "numpy", "scipy", "jax", "jaxlib", "equinox", "diffrax", "optimistix",
            "pandas")  # fmt: skip
"""Packages whose version may change a digit of a row."""

SETTINGS = ("XLA_FLAGS", "OPENBLAS_NUM_THREADS", "JAX_PLATFORMS", "JAX_ENABLE_X64")
"""Environment variables that may: the compiler's options, and in how many parts sums are taken."""

NUM_AT_ONCE = 8
"""Files whose digests are taken at once."""

Digests = Mapping[str, str]
"""SHA-256 by path as in the fleet file; empty for a file that cannot be read."""


@dataclass(frozen=True)
class Batch:
    """Machines that are worked out together.

    Attributes:
        entries: The machines.
        digests: Of all their files.
        folder: What their paths are relative to.
        network: The network.
        effects: Known effects beyond those of the motor files.
        seed: Random seed.
        numerics: What else the digits depend on, as `numerics`.
        num_planned: Machines that it was planned with: how they are fitted depends on it.
        discovers: Whether rows hold what the tests say of effects.
        name: SHA-256 of all of it but the folder.
    """

    entries: tuple[Entry, ...]
    digests: Digests
    folder: str
    network: NetworkForm
    effects: tuple[str, ...]
    seed: int
    numerics: Mapping[str, Any]
    num_planned: int
    discovers: bool = False
    name: str = ""

    def of_one(self, entry: Entry) -> Batch:
        """Return the batch of one of its machines."""
        own = {path: self.digests[path] for _, path in files_by_role(entry, self.folder)}
        return named(replace(self, entries=(entry,), digests=own))


def named(batch: Batch) -> Batch:
    """Return a batch under the name that its content gives it."""
    content = {
        "format": FORMAT,
        "entries": batch.entries,
        "digests": dict(sorted(batch.digests.items())),
        "network": network_text(batch.network),
        "effects": batch.effects,
        "seed": batch.seed,
        "numerics": batch.numerics,
        "num_planned": batch.num_planned,
        "discovers": batch.discovers,
    }
    return replace(batch, name=hashlib.sha256(to_json(content).encode()).hexdigest())


def numerics(**settings: str) -> dict[str, Any]:
    """Return what a row depends on beside its inputs: versions, compiler, threads.

    Args:
        **settings: Values of `SETTINGS` that hold where the rows are worked out, if not here.
    """
    held = {name: os.environ.get(name, "") for name in SETTINGS} | settings
    return {
        "python": platform.python_version(),
        "machine": platform.machine(),
        "packages": {name: version(name) for name in PACKAGES},
        "settings": held,
    }


def batches_of(
    fleet: Fleet, digests: Digests, size: int, *, seed: int, numerics: Mapping[str, Any],
    discovers: bool = False,
) -> list[Batch]:  # fmt: skip
    """Return the batches of a fleet: so many machines each, in the order of the file.

    Args:
        fleet: The fleet.
        digests: From `digests_of`.
        size: Machines in a batch.
        seed: Random seed.
        numerics: As `numerics`.
        discovers: Whether rows hold what the tests say of effects.
    """
    entries = _with_findings_on_copies(fleet, digests)
    found = []
    for start in range(0, len(entries), size):
        part = entries[start : start + size]
        own = {path: digests[path] for e in part for _, path in files_by_role(e, fleet.folder)}
        found.append(
            named(Batch(tuple(part), own, str(fleet.folder), fleet.network, fleet.effects, seed,
                        numerics, len(part), discovers))
        )  # fmt: skip
    return found


def digests_of(fleet: Fleet) -> dict[str, str]:
    """Return the SHA-256 of all files of a fleet, read several at once."""
    paths = list(dict.fromkeys(p for e in fleet.entries for _, p in files_by_role(e, fleet.folder)))

    with ThreadPoolExecutor(NUM_AT_ONCE) as pool:
        found = pool.map(digest_or_none, (fleet.folder / path for path in paths))
        return dict(zip(paths, found, strict=True))


def digest_or_none(path: Path) -> str:
    """Return the SHA-256 of a file; empty if it cannot be read, which its reader says in words."""
    try:
        return digest(path)
    except (OSError, ValueError, InputError):
        return ""


def files_by_role(entry: Entry, folder: str | Path) -> Iterator[tuple[str, str]]:
    """Give role and path, relative to the fleet file, of each file of a machine."""
    if entry.motor:
        yield "motor", entry.motor
    for role, tests in (("calibration", entry.tests), ("holdout", entry.holdout)):
        for test in tests:
            for file, _ in _files_of(test, folder):
                yield role, _relative(file, folder)


def resolved(test: str, folder: str | Path) -> Path:
    """Return a test as the readers take it: each of its files in the folder of the fleet file.

    Args:
        test: As the command line names it, such as `a.csv+b.csv@10Hz`.
        folder: The folder.
    """
    base = Path(folder)
    whole = base / test
    if "+" not in test or _exists(whole):
        return whole
    return Path("+".join(str(base / part) for part in test.split("+")))


def _files_of(test: str, folder: str | Path) -> Sequence[tuple[Path, str | None]]:
    try:
        return files_of(resolved(test, folder))
    except InputError:
        return ()  # a stretch that is none: said of the machine when it is read


def _relative(file: Path, folder: str | Path) -> str:
    return str(file.relative_to(folder) if file.is_relative_to(folder) else file)


def _exists(path: Path) -> bool:
    try:
        return path.exists()
    except (OSError, ValueError):
        return False


def _with_findings_on_copies(fleet: Fleet, digests: Digests) -> list[Entry]:
    """Return the machines, those that share a test with another one with a warning."""
    owners: dict[str, list[str]] = {}
    own: list[list[tuple[str, str]]] = []
    for entry in fleet.entries:
        files = [(p, digests[p]) for r, p in files_by_role(entry, fleet.folder) if r != "motor"]
        own.append([(path, sha) for path, sha in files if sha])
        for sha in {sha for _, sha in own[-1]}:
            owners.setdefault(sha, []).append(entry.machine)
    entries = []
    for entry, files in zip(fleet.entries, own, strict=True):
        found = [
            Finding(
                "test_of_another", "warning",
                f"{path} holds the same bytes as a test of {_others(owners[sha], entry.machine)}.",
                remedy="Check whether a file was copied under another name; machines that share a "
                "test make a type look more alike than it is.",
            )
            for path, sha in dict(files).items()
            if len(owners[sha]) > 1
        ]  # fmt: skip
        entries.append(replace(entry, findings=(*entry.findings, *found)) if found else entry)
    return entries


def _others(machines: Sequence[str], own: str) -> str:
    others = [machine for machine in machines if machine != own]
    more = f" and {len(others) - 3} more" if len(others) > 3 else ""
    return ", ".join(others[:3]) + more
