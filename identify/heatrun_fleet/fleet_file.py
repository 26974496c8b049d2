"""Reading the fleet file: the machines of a fleet and the model that all of them get.

[fleet]
name = "IPM line 3"
model = "second"                 # a built-in network, or a TOML file
motor = "motor.toml"             # of machines that name none
type = "IPM-A"                   # likewise
effects = ["speed_cooling"]      # known effects of all machines
manifest = "machines.csv"        # or machines written here:
[[machines]]
id = "A-0001"
tests = ["a1_cold.csv", "a1_drive.csv"]
holdout = ["a1_road.csv"]
supplier = "north"               # any other key is a covariate

A fleet is worked out in batches: what a worker is given, with the name that stands for all of it.
"""

from __future__ import annotations

import hashlib
import os
import platform
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

from heatrun.errors import InputError
from heatrun.io.open_file import digest, read_start
from heatrun.io.toml_text import LARGEST_BYTES, check_keys, parse_toml, section_of, shown, text_of
from heatrun.model.network_form import NetworkForm
from heatrun.model.network_text import network_named, network_text
from heatrun.readers.joined import files_of
from heatrun.record.record import Finding
from heatrun.results.values import to_json

from .entries import ALIASES, COLUMNS, Entry, Row, cell_text, check_columns, gathered, read_manifest
from .rows import FORMAT

KEYS = ("name", "model", "motor", "type", "effects", "manifest", "covariates")

LISTS = ("effects", "covariates")

ENDS = (".parquet", ".csv", ".tsv", ".txt")
"""Of a manifest that is given in place of a fleet file."""


@dataclass(frozen=True)
class Fleet:
    """What a fleet file says."""

    name: str  # As it stands on results.
    network: NetworkForm  # The network of all machines.
    effects: tuple[str, ...]  # Ids of known effects beyond those of the motor files.
    entries: tuple[Entry, ...]  # The machines, in the order of the file.
    folder: Path  # What paths are relative to, absolute.
    inputs: Mapping[str, str]  # SHA-256 by name of the fleet file and of the manifest.


def load_fleet(path: str | Path, model: str | NetworkForm | None = None) -> Fleet:
    """Read a fleet file, or the table of its machines alone.

    Args:
        path: A TOML file with `[fleet]` and `[[machines]]` or a manifest; or the manifest itself,
            a CSV or Parquet table with the columns machine, type, motor, test (or tests), holdout
            and role (`calibration` or `holdout`); other columns are covariates.
        model: Network in place of the one that the file names.

    Raises:
        InputError: If a file cannot be read, has a key or column that is not known, or names no
            machine. A single row that is wrong raises nothing: its machine carries a finding.
    """
    path = Path(path)
    where, folder = str(path), path.resolve().parent
    is_alone = path.suffix.lower() in ENDS
    if is_alone:
        texts, lists, machines, inputs = {"name": path.stem, "manifest": path.name}, {}, None, {}
    else:
        data = read_start(path, LARGEST_BYTES)
        texts, lists, machines = _said(data, where)
        inputs = {path.name: hashlib.sha256(data).hexdigest()}
    table = texts.get("manifest", path.name)
    if machines is not None:
        names, rows = _rows_of(machines, where)
    else:
        names, rows = read_manifest(path if is_alone else folder / table)
        inputs[table] = digest(folder / table)
    check_columns(names, lists.get("covariates"), table)
    if is_alone and "motor" not in names:
        raise InputError(
            "Expected a column motor with the motor files, found none.",
            where=where,
            remedy="Add it; or write a fleet file with [fleet] name, motor and manifest = "
            f'"{path.name}", and give that.',
        )
    said = texts.get("model", "second")
    own = str(folder / said) if said.endswith(".toml") else said  # relative to the file
    return Fleet(
        name=texts["name"],
        network=network_named(own if model is None else model),
        effects=lists.get("effects", ()),
        entries=gathered(
            rows, type=texts.get("type", ""), motor=texts.get("motor", ""), where=table
        ),
        folder=folder,
        inputs=inputs,
    )


def _said(data: bytes, where: str) -> tuple[dict[str, str], dict[str, tuple[str, ...]], Any]:
    """Return the texts and lists of a fleet file, and its `[[machines]]` if they stand in it."""
    if len(data) > LARGEST_BYTES:
        raise InputError(
            f"Expected a fleet file of at most {LARGEST_BYTES // 2**20} MB, got more.",
            where=where,
            remedy='Write the machines into a table and name it: manifest = "machines.csv".',
        )
    content = parse_toml(data, where, "fleet file")
    check_keys(content, ("fleet", "machines"), where, "section")
    fleet = section_of(content, "fleet", where)
    at = f"{where}, [fleet]"
    check_keys(fleet, KEYS, at, "key")
    texts = {k: text_of(fleet, k, at) for k in KEYS if k in fleet and k not in LISTS}
    if "name" not in texts:
        raise InputError(
            "Expected the name of the fleet, found none.", where=at, remedy='Add: name = "…".'
        )
    if ("manifest" in texts) == ("machines" in content):
        raise InputError(
            "Expected either a manifest or [[machines]], got "
            f"{'both' if 'machines' in content else 'neither'}.",
            where=at,
            remedy='Write manifest = "machines.csv", or [[machines]] with id and tests for each.',
        )
    lists = {k: _texts(fleet[k], k, at) for k in LISTS if k in fleet}
    return texts, lists, content.get("machines")


def _rows_of(machines: Any, where: str) -> tuple[list[str], list[Row]]:
    """Return columns and rows of `[[machines]]`."""
    if not isinstance(machines, list) or not all(isinstance(each, dict) for each in machines):
        raise InputError(
            f"Expected [[machines]], got {shown(machines)}.",
            where=where,
            remedy="Write [[machines]] on a line of its own for each machine.",
        )
    if not machines:
        raise InputError(
            "Expected at least one machine, found none.",
            where=where,
            remedy="Write [[machines]] and below it id and tests.",
        )
    names: dict[str, None] = {}
    rows = []
    for number, machine in enumerate(machines, start=1):
        problem = ""
        cells: dict[str, str] = {}
        for key, value in machine.items():
            name = ALIASES.get(str(key), str(key))
            names[name] = None
            if isinstance(value, dict):
                problem = f"Expected a text or a list for {key}, got {shown(value)}."
            elif name in cells:
                problem = f"{key} and another key for {name} are given."
            elif text := cell_text(value).strip():
                cells[name] = text
        rows.append(Row(f"[[machines]] {number}", cells, problem))
    if not {"test", "tests"} & set(names):
        names["tests"] = None  # said of each machine by a finding of its own
    if "machine" not in names:
        names["machine"] = None
    return list(names), rows


def _texts(value: Any, key: str, where: str) -> tuple[str, ...]:
    if not isinstance(value, list) or not all(isinstance(each, str) for each in value):
        raise InputError(
            f"Expected a list of texts for {key}, got {shown(value)}.",
            where=where,
            remedy=f'Write {key} = ["…"].',
        )
    known = [name for name in value if name in COLUMNS]
    if key == "covariates" and known:
        raise InputError(
            f"{known[0]} has a meaning of its own and is no covariate.", where=where,
            remedy="Leave it out of the list, or rename the column.",
        )  # fmt: skip
    return tuple(value)


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
    """Machines that are worked out together."""

    entries: tuple[Entry, ...]  # The machines.
    digests: Digests  # Of all their files.
    folder: str  # What their paths are relative to.
    network: NetworkForm  # The network.
    effects: tuple[str, ...]  # Known effects beyond those of the motor files.
    seed: int  # Random seed.
    numerics: Mapping[str, Any]  # What else the digits depend on, as `numerics`.
    num_planned: int  # Machines that it was planned with: how they are fitted depends on it.
    discovers: bool = False  # Whether rows hold what the tests say of effects.
    name: str = ""  # SHA-256 of all of it but the folder.

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
    """Return what a row depends on beside its inputs: versions, compiler, threads; with the values
    of `SETTINGS` that hold where the rows are worked out, if not here.
    """
    return {
        "python": platform.python_version(),
        "machine": platform.machine(),
        "packages": {name: version(name) for name in PACKAGES},
        "settings": {name: os.environ.get(name, "") for name in SETTINGS} | settings,
    }


def batches_of(
    fleet: Fleet, digests: Digests, size: int, *, seed: int, numerics: Mapping[str, Any],
    discovers: bool = False,
) -> list[Batch]:  # fmt: skip
    """Return the batches of a fleet: so many machines each, in the order of the file; arguments as
    the attributes of `Batch`.
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
            with suppress(InputError):  # a stretch that is none: said when the machine is read
                for file, _ in files_of(resolved(test, folder)):
                    own = file.relative_to(folder) if file.is_relative_to(folder) else file
                    yield role, str(own)


def resolved(test: str, folder: str | Path) -> Path:
    """Return a test such as `a.csv+b.csv@10Hz` as the readers take it: each of its files in the
    folder of the fleet file.
    """
    base = Path(folder)
    whole = base / test
    try:
        is_one = "+" not in test or whole.exists()
    except (OSError, ValueError):  # no file can have this name
        is_one = False
    return whole if is_one else Path("+".join(str(base / part) for part in test.split("+")))


def _with_findings_on_copies(fleet: Fleet, digests: Digests) -> list[Entry]:
    """Return the machines, those that share a test with another one with a warning."""
    owners: dict[str, list[str]] = {}
    own: list[dict[str, str]] = []
    for entry in fleet.entries:
        files = [path for role, path in files_by_role(entry, fleet.folder) if role != "motor"]
        own.append({path: digests[path] for path in files if digests[path]})
        for sha in set(own[-1].values()):
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
            for path, sha in files.items()
            if len(owners[sha]) > 1
        ]  # fmt: skip
        entries.append(replace(entry, findings=(*entry.findings, *found)) if found else entry)
    return entries


def _others(machines: Sequence[str], own: str) -> str:
    others = [machine for machine in machines if machine != own]
    more = f" and {len(others) - 3} more" if len(others) > 3 else ""
    return ", ".join(others[:3]) + more
