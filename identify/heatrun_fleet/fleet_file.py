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
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from heatrun.errors import InputError
from heatrun.io.open_file import read_start
from heatrun.io.toml_text import LARGEST_BYTES, check_keys, parse_toml, shown, text_of
from heatrun.model.network_form import NetworkForm
from heatrun.model.network_text import network_named

from .entries import ALIASES, COLUMNS, Entry, Row, cell_text, check_columns, gathered, read_manifest

KEYS = ("name", "model", "motor", "type", "effects", "manifest", "covariates")

ENDS = (".parquet", ".csv", ".tsv", ".txt")
"""Of a manifest that is given in place of a fleet file."""


@dataclass(frozen=True)
class Fleet:
    """What a fleet file says.

    Attributes:
        name: As it stands on results.
        network: The network of all machines.
        effects: Ids of known effects beyond those of the motor files.
        entries: The machines, in the order of the file.
        folder: What paths are relative to, absolute.
        path: The file, as it was named.
        inputs: SHA-256 by name of the fleet file and of the manifest.
    """

    name: str
    network: NetworkForm
    effects: tuple[str, ...]
    entries: tuple[Entry, ...]
    folder: Path
    path: str
    inputs: Mapping[str, str]


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
    if path.suffix.lower() in ENDS:
        return _of_manifest(path, model)
    data = read_start(path, LARGEST_BYTES)
    where = str(path)
    if len(data) > LARGEST_BYTES:
        raise InputError(
            f"Expected a fleet file of at most {LARGEST_BYTES // 2**20} MB, got more.",
            where=where,
            remedy='Write the machines into a table and name it: manifest = "machines.csv".',
        )
    content = parse_toml(data, where, "fleet file")
    check_keys(content, ("fleet", "machines"), where, "section")
    fleet = content.get("fleet", {})
    if not isinstance(fleet, dict):
        raise InputError(
            f"Expected a section, got {shown(fleet)}.", where=f"{where}, fleet",
            remedy="Write [fleet] on a line of its own.",
        )  # fmt: skip
    at = f"{where}, [fleet]"
    check_keys(fleet, KEYS, at, "key")
    texts = {k: text_of(fleet, k, at) for k in KEYS if k in fleet and not _is_list(k)}
    if "name" not in texts:
        raise InputError(
            "Expected the name of the fleet, found none.", where=at, remedy='Add: name = "…".'
        )
    covariates = _texts(fleet, "covariates", at) if "covariates" in fleet else None
    folder = path.resolve().parent
    inputs = {path.name: hashlib.sha256(data).hexdigest()}
    if ("manifest" in texts) == ("machines" in content):
        raise InputError(
            "Expected either a manifest or [[machines]], got "
            f"{'both' if 'machines' in content else 'neither'}.",
            where=at,
            remedy='Write manifest = "machines.csv", or [[machines]] with id and tests for each.',
        )
    if "manifest" in texts:
        table = folder / texts["manifest"]
        names, rows = read_manifest(table)
        table_where = texts["manifest"]
        inputs[texts["manifest"]] = _sha256(table)
    else:
        names, rows = _rows_of(content["machines"], where)
        table_where = path.name
    check_columns(names, covariates, table_where)
    return Fleet(
        name=texts["name"],
        network=_network(model, texts.get("model", "second"), folder),
        effects=_texts(fleet, "effects", at),
        entries=gathered(
            rows, type=texts.get("type", ""), motor=texts.get("motor", ""), where=table_where
        ),
        folder=folder,
        path=where,
        inputs=inputs,
    )


def _of_manifest(path: Path, model: str | NetworkForm | None) -> Fleet:
    names, rows = read_manifest(path)
    check_columns(names, None, path.name)
    if "motor" not in names:
        raise InputError(
            "Expected a column motor with the motor files, found none.",
            where=str(path),
            remedy="Add it; or write a fleet file with [fleet] name, motor and manifest = "
            f'"{path.name}", and give that.',
        )
    return Fleet(
        name=path.stem,
        network=network_named(model or "second"),
        effects=(),
        entries=gathered(rows, type="", motor="", where=path.name),
        folder=path.resolve().parent,
        path=str(path),
        inputs={path.name: _sha256(path)},
    )


def _network(model: str | NetworkForm | None, said: str, folder: Path) -> NetworkForm:
    """Return the network that was asked for, or the file's, which is relative to the file."""
    if model is not None:
        return network_named(model)
    return network_named(str(folder / said) if said.endswith(".toml") else said)


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


def _is_list(key: str) -> bool:
    return key in ("effects", "covariates")


def _texts(fleet: Mapping[str, Any], key: str, where: str) -> tuple[str, ...]:
    value = fleet.get(key, [])
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


def _sha256(path: Path) -> str:
    from heatrun.io.open_file import digest

    return digest(path)
