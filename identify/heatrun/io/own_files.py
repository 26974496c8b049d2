"""What heatrun itself has written, told from bench files: nobody measured it."""

import os
import re
import shlex
import zipfile
import zlib
from collections.abc import Collection
from pathlib import Path

from ..errors import InputError
from .open_file import read_start

ENDINGS = (
    *(".csv", ".txt", ".dat", ".tsv", ".asc", ".mat", ".parquet", ".mf4", ".mdf", ".tdms"),
    *(".xlsx", ".xlsm"),
)
"""Endings of bench files, alone or with `.gz`."""

RUN_FILES = ("manifest.json", "fit.json")
"""What every run folder holds."""

EXPORT = b"MATLAB 5.0 MAT-file, heatrun "
"""How the MAT files of `heatrun export` begin."""

SIMULATED = frozenset({"copper_loss_W", "other_loss_W"})
"""Columns of a virtual record that no bench measures."""

SCRIPT_COURSES = ("prova_course.csv", "network_course.csv")
"""What run_prova.m and run_network.m write."""

MOST_BYTES = 8192
"""Bytes at the start of a file that are looked at [1]: the names of its columns."""

ROWS = re.compile(r"(?:machines|population|[0-9a-f]{64}(?:\.lost)?)\.parquet")
"""Names of the files of rows that `heatrun fleet` and `heatrun population` write."""

MACHINE = frozenset({"machine", "machine_id", "id", "serial"})
"""Names of the column of a table of machines that names them."""

SHEETS = frozenset({"Parameters", "Correlation", "Columns", "Residuals", "Findings"})
"""Sheets of the workbook of a run, beside others."""

MOST_LISTED_BYTES = 1 << 16
"""Longest list of the sheets of a workbook that is looked at."""

SIMULATION, TABLE, COURSE, SCRIPT_COURSE, EXPORTED, WORKBOOK, FLEET, MACHINES = (
    "a virtual record that heatrun simulated",
    "the tables of a report of heatrun",
    "a course that heatrun has computed",
    "a course that a script of heatrun has computed",
    "an export of heatrun",
    "the workbook of a run of heatrun",
    "rows of a fleet that heatrun has written",
    "a table of the machines of a fleet",
)
"""What a file of heatrun's own is, in words."""

READABLE = (SCRIPT_COURSE, EXPORTED, MACHINES)
"""Of these, what can be read where its name is given; a table of machines fails by itself."""


def is_run_folder(path: Path) -> bool:
    """Return whether a folder is a run of heatrun."""
    return all((path / name).is_file() for name in RUN_FILES)


def own_file(name: str, start: bytes) -> str | None:
    """Return what of heatrun's own a file is by its first bytes, in words; None for what may be a
    bench file. A course of a script has columns that a logger may have: its name tells it.
    """
    if start.startswith(b"\x1f\x8b"):
        try:
            start = zlib.decompressobj(wbits=31).decompress(start, MOST_BYTES)
        except zlib.error:
            return None
    if start.startswith(EXPORT):
        return EXPORTED
    if start.startswith(b"PAR1") and ROWS.fullmatch(name):
        return FLEET
    text = start.removeprefix(b"\xef\xbb\xbf").decode("latin-1")
    columns = [column.strip() for column in text.partition("\n")[0].split(",")]
    if is_simulated(columns):
        return SIMULATION
    if columns == ["table", "of", "quantity", "value", "unit", "note"]:
        return TABLE
    if _is_table_of_machines(text):
        return MACHINES
    if "measured_degC" in columns and any("_parameters_95_" in one for one in columns):
        return COURSE
    return SCRIPT_COURSE if name in SCRIPT_COURSES else None


def _is_table_of_machines(text: str) -> bool:
    """Return whether there is a machine in a column and a file in one of tests."""
    head, _, rest = text.partition("\n")
    sign = max(",;\t", key=head.count)
    head_cells, cells = (
        [cell.strip().strip('"') for cell in line.split(sign)]
        for line in (head, rest.partition("\n")[0])
    )
    row = dict(zip((cell.lower() for cell in head_cells), cells, strict=False))
    tests = row.get("tests", row.get("test", ""))
    return not MACHINE.isdisjoint(row) and Path(tests.partition("@")[0]).suffix[1:2].isalpha()


def own_file_at(path: Path) -> str | None:
    """Return as `own_file` for a file on the disk; None for one that cannot be read."""
    try:
        start = read_start(path, MOST_BYTES)
    except (InputError, OSError, ValueError):
        return None
    if start.startswith(b"PK\x03\x04"):
        return WORKBOOK if _sheets(path) >= SHEETS else None
    return own_file(path.name, start)


def refuse_own_file(path: Path, *, for_fit: bool) -> None:
    """Refuse a file that heatrun itself has written; a virtual record is a matter of the checks.

    If it is not for a fit, a course of a script may be looked at, and the test that an export holds
    be simulated again.

    Raises:
        InputError: If it is one.
    """
    if not os.path.isfile(path):  # a pipe gives what it holds only once
        return
    said = own_file_at(path)
    if said in (None, SIMULATION) or (not for_fit and said in READABLE):
        return
    remedy = "Name the bench file that it was made from."
    if said == MACHINES:
        command = f"heatrun fleet {shlex.quote(str(path))}"
        remedy = f"Calibrate them by {command}, or name the test of one of them."
    raise InputError(f"Expected a bench file, this is {said}.", where=str(path), remedy=remedy)


def _sheets(path: Path) -> set[str]:
    try:
        with zipfile.ZipFile(path) as archive, archive.open("xl/workbook.xml") as file:
            listed = file.read(MOST_LISTED_BYTES).decode("utf-8", "replace")
    except (OSError, ValueError, KeyError, RuntimeError, zipfile.BadZipFile, zlib.error):
        return set()
    return set(re.findall(r'<sheet name="([^"]*)"', listed))


def is_simulated(columns: Collection[str]) -> bool:
    """Return whether columns are those of a virtual record."""
    flows = [name for name in columns if name.startswith("flow_") and name.endswith("_W")]
    return set(columns) >= SIMULATED and bool(flows)
