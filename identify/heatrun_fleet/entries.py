"""The machines of a fleet as its file names them: rows of a table, gathered by machine.

The table is CSV with any of three delimiters, or Parquet. A row that cannot be used never stops the
others: its machine is kept, with the finding that says why, and is refused when its turn comes.
"""

import csv
import io
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from heatrun.errors import InputError, did_you_mean
from heatrun.io.open_file import read_start
from heatrun.readers.foreign import library, reading
from heatrun.record.record import Finding

ROLES = ("calibration", "holdout")

COLUMNS = ("machine", "type", "motor", "test", "tests", "holdout", "role")
"""What heatrun knows of a row; any other column is a covariate."""

ALIKE = 0.85
"""Likeness [1] from which on a column is misspelt: `motors`, `machin`, not `date` or `rotor`."""

ALIASES = {"id": "machine", "machine_id": "machine", "serial": "machine"}

BETWEEN = "|"
"""Between several tests in one cell: no sign of the words that name a test."""


@dataclass(frozen=True)
class Row:
    """A row of the fleet's table: where it stands, such as `"line 7"`, its texts by column without
    empty cells, and why it cannot be read as one, empty if it can.
    """

    place: str
    cells: Mapping[str, str]
    problem: str = ""


@dataclass(frozen=True)
class Entry:
    """A machine of the fleet."""

    machine: str  # Its name, unique in the fleet.
    type: str  # What it is one of; empty if nothing is said.
    motor: str  # Its motor file, relative to the fleet file; empty if none is named.
    # Tests that are fitted, as the command line names them, relative to the fleet file.
    tests: tuple[str, ...]
    holdout: tuple[str, ...] = ()  # Tests that are predicted only.
    # Further columns with their texts, in the order of the file.
    covariates: tuple[tuple[str, str], ...] = ()
    # What its rows suffer from; one of severity `"error"` refuses the machine.
    findings: tuple[Finding, ...] = ()

    @property
    def is_refused(self) -> bool:
        """Whether its rows alone forbid a fit."""
        return any(finding.severity == "error" for finding in self.findings)


def check_columns(names: Sequence[str], covariates: Sequence[str] | None, where: str) -> None:
    """Refuse a table whose columns, after `ALIASES`, cannot be what was meant.

    Where the fleet file does not list covariates, every column is one whose name is not close to
    one of `COLUMNS`.

    Raises:
        InputError: If a column is missing, there twice, not known, or looks misspelt.
    """
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise InputError(
            f"The column '{twice[0]}' stands there twice.",
            where=where,
            remedy="Rename or remove one of them; id, machine_id and serial mean machine.",
        )
    if "machine" not in names:
        raise InputError(
            f"Expected a column machine, found {', '.join(names)[:200] or 'none'}.",
            where=where,
            remedy="Name the column that tells the machines apart machine (or id).",
        )
    if not {"test", "tests"} & set(names):
        raise InputError(
            "Expected a column test or tests with the bench files, found none.",
            where=where,
            remedy=f"Several files in a cell stand between {BETWEEN!r}, or in rows of their own.",
        )
    for name in names:
        if name in COLUMNS or (covariates is not None and name in covariates):
            continue
        is_misspelt = get_close_matches(name.casefold(), COLUMNS, cutoff=ALIKE)
        near = did_you_mean(name, COLUMNS) if is_misspelt else ""
        if covariates is not None or near:
            raise InputError(
                f"The column '{name[:60]}' is not known. {near}".strip(),
                where=where,
                remedy=f"Known are {', '.join(COLUMNS)}; name covariates in "
                f'[fleet] covariates = ["{name[:60]}"].',
            )


def gathered(rows: Sequence[Row], *, type: str, motor: str, where: str) -> tuple[Entry, ...]:
    """Return the machines of a table in the order of their first rows; type and motor file are
    those of machines whose rows name none.
    """
    by_machine: dict[str, list[Row]] = {}
    for row in rows:
        name = row.cells.get("machine", "")
        by_machine.setdefault(name or f"({row.place})", []).append(row)
    return tuple(_entry(name, group, type, motor, where) for name, group in by_machine.items())


def _entry(name: str, rows: Sequence[Row], type: str, motor: str, where: str) -> Entry:
    findings: list[Finding] = []

    def wrong(id: str, row: Row, message: str, remedy: str = "Correct the row.") -> None:
        findings.append(Finding(id, "error", message, f"{where}, {row.place}", remedy))

    first = rows[0]
    for row in rows:
        if row.problem:
            wrong("bad_row", row, row.problem)
    if "machine" not in first.cells:
        wrong("no_machine", first, "The row names no machine.",
              "Write the name of the machine into the column machine.")  # fmt: skip
    said: dict[str, str] = {}
    for row in rows:
        for column, text in row.cells.items():
            if column in ("machine", "test", "tests", "holdout", "role"):
                continue
            if (before := said.setdefault(column, text)) != text:
                wrong("contradictory_rows", row,
                      f"{column} is {before!r:.60} in one row and {text!r:.60} in another.",
                      "One machine has one of it: correct the rows, or give the machines names of "
                      "their own.")  # fmt: skip
    tests: dict[str, list[str]] = {role: [] for role in ROLES}
    for row in rows:
        role = row.cells.get("role", ROLES[0]).casefold()
        if role not in ROLES:
            near = did_you_mean(role, ROLES)
            expected = f"Expected the role {' or '.join(ROLES)}, got {role!r:.60}. {near}"
            wrong("unknown_role", row, expected.strip())
            role = ROLES[0]
        tests[role] += [*_files(row, "test"), *_files(row, "tests")]
        tests["holdout"] += _files(row, "holdout")
    if not tests["calibration"]:
        wrong("no_test", first, "The machine has no test to be fitted.",
              "Name a bench file in the column test.")  # fmt: skip
    for test, num in Counter(test for role in ROLES for test in tests[role]).items():
        if num > 1:
            wrong("duplicate_test", first, f"The test {test[:200]} is named {num} times.",
                  "Name each test once: twice the same readings would look twice as "
                  "sure.")  # fmt: skip
    if not (motor := said.pop("motor", motor)):
        wrong("no_motor", first, "No motor file is named.", "Fill the column motor, or write "
              'motor = "motor.toml" under [fleet] of a fleet file.')  # fmt: skip
    return Entry(
        machine=name,
        type=said.pop("type", type),
        motor=motor,
        tests=tuple(tests["calibration"]),
        holdout=tuple(tests["holdout"]),
        covariates=tuple(said.items()),
        findings=tuple(findings),
    )


def _files(row: Row, column: str) -> list[str]:
    return [part.strip() for part in row.cells.get(column, "").split(BETWEEN) if part.strip()]


LARGEST_BYTES = 2**28
"""Largest table; a million machines of 200 letters have 200 MB."""

LONGEST_CELL = 10_000
"""Letters of a cell; twenty tests with their folders have 2000."""

DELIMITERS = (",", ";", "\t")


def read_manifest(path: str | Path) -> tuple[list[str], list[Row]]:
    """Return the columns and rows of the table of the machines, Parquet or text with a heading.

    `ALIASES` are resolved and blank rows left out. A row that has too many cells or one that is too
    long has a problem.

    Raises:
        InputError: If the file cannot be read, is no table, or holds no row.
    """
    where = str(path)
    data = read_start(path, LARGEST_BYTES)
    if len(data) > LARGEST_BYTES:
        raise InputError(
            f"Expected a table of at most {LARGEST_BYTES // 2**20} MB, got more.",
            where=where,
            remedy="Check that this is the table of the machines; or make several fleets.",
        )
    is_parquet = data[:4] == b"PAR1"
    names, rows = _of_parquet(data, where) if is_parquet else _of_text(data, where)
    names = [ALIASES.get(name, name) for name in names]
    rows = [
        Row(row.place, {ALIASES.get(k, k): v for k, v in row.cells.items()}, row.problem)
        for row in rows
        if row.cells or row.problem
    ]
    if not rows:
        raise InputError(
            "Expected at least one row with a machine, found none.",
            where=where,
            remedy="Write a row for each machine: its name and its tests.",
        )
    return names, rows


def _of_text(data: bytes, where: str) -> tuple[list[str], list[Row]]:
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(
            f"Expected UTF-8 text, got another byte at position {error.start}.",
            where=where,
            remedy="Save the table as UTF-8, in spreadsheets as 'CSV UTF-8'.",
        ) from error
    heading = next((line for line in text.splitlines() if line.strip()), "")
    if "\0" in heading:
        raise InputError(
            "Expected a table of machines as text or Parquet, got something else.",
            where=where,
            remedy="Name a file with a heading such as machine,type,test.",
        )
    delimiter = max(DELIMITERS, key=heading.count)
    lines = csv.reader(io.StringIO(text), delimiter=delimiter)
    try:
        names: list[str] = []
        rows: list[Row] = []
        for cells in lines:
            if not any(cell.strip() for cell in cells):
                continue
            if not names:
                names = [cell.strip() for cell in cells]
                continue
            rows.append(_row(f"line {lines.line_num}", names, cells))
    except csv.Error as error:
        raise InputError(
            f"The table cannot be read ({error} in line {lines.line_num}).",
            where=where,
            remedy="Look for a quote that is never closed.",
        ) from error
    return names, rows


def _row(place: str, names: Sequence[str], cells: Sequence[str]) -> Row:
    problem = ""
    if any(cell.strip() for cell in cells[len(names) :]):
        problem = f"Expected {len(names)} cells as in the heading, got {len(cells)}."
    if any(len(cell) > LONGEST_CELL for cell in cells):
        problem = f"A cell has more than {LONGEST_CELL} letters."
        cells = [cell[:LONGEST_CELL] for cell in cells]
    given = zip(names, (cell.strip() for cell in cells), strict=False)
    return Row(place, {name: cell for name, cell in given if cell}, problem)


def _of_parquet(data: bytes, where: str) -> tuple[list[str], list[Row]]:
    pyarrow = library("pyarrow.parquet", "Parquet", where)
    with reading("a Parquet table", where):
        table = pyarrow.ParquetFile(io.BytesIO(data)).read()
        held = table.to_pylist()
    names = list(table.column_names)
    rows = [
        _row(f"row {number}", names, [cell_text(each) for each in row.values()])
        for number, row in enumerate(held, start=1)
    ]
    return names, rows


def cell_text(value: Any) -> str:
    """Return the text of a value from Parquet or TOML; empty for none.

    A list is several tests; a date and a time are written as ISO 8601 has them.
    """
    if value is None:
        return ""
    if isinstance(value, list | tuple):
        return BETWEEN.join(cell_text(each) for each in value)
    if isinstance(value, bool):
        return "true" if value else "false"
    if hasattr(value, "isoformat"):
        return value.isoformat()
    return str(value)
