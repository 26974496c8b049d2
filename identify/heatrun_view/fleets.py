"""Fleets that the page can show: rows of their machines, all that is known of one, populations."""

import hashlib
import io
import json
import math
import shlex
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from heatrun.errors import InputError
from heatrun.io.quantities import printed_unit
from heatrun.record.record import Finding
from heatrun.reports.printed import format_interval, format_value

from .gate import is_inside, read_inside
from .store import Stamp
from .words import findings_html, message, table

MACHINES, POPULATION, MANIFEST = "machines.parquet", "population.parquet", "manifest.json"
PARTS = "parts"

MAX_BYTES = 500_000_000
"""Largest file of rows that is read [byte]: some 100 000 machines."""

DEEPEST = 3
"""Levels of folders below the one that is shown in which fleets are looked for."""

Row = Mapping[str, Any]


@dataclass(frozen=True)
class Fleet:
    """A folder that `heatrun fleet` wrote or is writing; outside the root nothing is read."""

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
    """Return the fleets in a folder and below it, the folder itself first."""
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
    from heatrun_fleet.rows import read_part  # needs pyarrow

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


TWO_SIDED_95 = 1.959964

ROOM = 5.0
"""Half of the width of a strip, in robust standard deviations over the machines of the type."""

STRIP = 100
"""Units of a strip from its left end to its right."""

UNKNOWN = -math.inf


def columns(rows: Sequence[Row], sisters: Mapping[str, Row]) -> dict[str, list[Any]]:
    """Return what stands in the table, by column.

    Numbers that are not known are minus infinity: sorted from the largest on, they come last.

    `value_0`, `value_1`, … are the most probable values in the order of `parameters`, and `text_0`,
    … the same with 95 % interval. `strip` holds for each parameter where interval and value lie
    among the machines of the type, from 0 to 100.
    """
    found: dict[str, list[Any]] = {
        "machine": [row["machine"] for row in rows],
        "type": [row["type"] for row in rows],
        "covariates": [", ".join(v for _, v in row["covariates"] or []) for row in rows],
        "verdict": [verdict(row, sisters.get(row["machine"])) for row in rows],
        "strip": _strips(rows),
        "outlier": [_number(sisters.get(row["machine"], {}).get("outlier_probability"))
                    for row in rows],
        "rmse": [_number(row["rmse_K"]) for row in rows],
        "warnings": [sum(f.severity != "note" for f in findings(row)) for row in rows],
    }  # fmt: skip
    said = [intervals(row) for row in rows]
    for place, name in enumerate(parameters(rows)):
        own = [each.get(name) for each in said]
        found[f"value_{place}"] = [UNKNOWN if each is None else each[1] for each in own]
        found[f"text_{place}"] = ["" if each is None else _ranged(*each) for each in own]
    return found


def parameters(rows: Sequence[Row]) -> dict[str, str]:
    """Return the names of the thermal parameters of all machines, with their units."""
    return {
        name: unit
        for row in rows
        for name, unit in zip(row["parameters"] or [], row["parameter_units"] or [], strict=True)
    }


def intervals(row: Row) -> dict[str, tuple[float, float, float]]:
    """Return lower limit of the 95 % interval, most probable value and upper limit, by name."""
    if not row["parameters"]:
        return {}
    num = len(row["parameters"])
    sd = np.sqrt(np.diag(np.reshape(row["log_covariance"], (num, num))))
    found = {}
    for name, transform, value, mean, error in zip(
        row["parameters"], row["transforms"], row["parameter_values"], row["log_mean"], sd,
        strict=True,
    ):  # fmt: skip
        ends = mean + TWO_SIDED_95 * error * np.array([-1.0, 1.0])
        low, high = np.exp(ends) if transform == "log" else ends
        found[name] = (float(low), float(value), float(high))
    return found


def findings(row: Row) -> list[Finding]:
    """Return the findings of a machine."""
    return [Finding(**each) for each in json.loads(row["findings"] or "[]")]


def files(row: Row, role: str) -> list[str]:
    """Return the files of a role, motor, calibration or holdout, as the fleet file names them."""
    return [each["path"] for each in row["inputs"] or [] if each["role"] == role]


def verdict(row: Row, sister: Row | None) -> str:
    """Return in a few words what became of a machine, and what its population says of it."""
    if row["status"] != "fitted":
        return str(row["status"])
    if not row["is_converged"]:
        return "not converged"
    if sister is not None and sister["is_outlier"]:
        return "does not fit its type"
    return "fitted"


def headline(rows: Sequence[Row], sisters: Mapping[str, Row], is_whole: bool) -> str:
    """Return in a sentence or two what the fleet is."""
    count = Counter(verdict(row, sisters.get(row["machine"])) for row in rows)
    said = ", ".join(f"{num} {word}" for word, num in sorted(count.items()))
    words = f"{len(rows)} machines: {said}."
    if not is_whole:
        words += " The fleet is being worked out: these are the machines that are there so far."
    if not sisters:
        words += (
            " No population of these machines is in the folder: `heatrun population` says which "
            "do not fit their type."
        )
    return words


def details(row: Row, sister: Row | None) -> str:
    """Return all that is known of a machine, its population included, as HTML."""
    kind = f" · type {escape(row['type'])}" if row["type"] else ""
    said = "".join(f" · {escape(k)} {escape(v)}" for k, v in row["covariates"] or [])
    parts = [f"<h3>{escape(row['machine'])}{kind}{said}</h3>"]
    word = verdict(row, sister)
    parts.append(f"<p>{escape(word)}{'' if word == 'fitted' else _why(row, sister)}</p>")
    if row["parameters"]:
        head, lines = _parameter_rows(row, sister)
        parts.append(table(head, lines))
        keys = ("holdout_tests", "holdout_rmse_K", "holdout_coverage_95")
        heldout = [
            (name, f"{rmse:.2f} K", f"{100 * inside:.0f} %")
            for name, rmse, inside in zip(*(row[key] or [] for key in keys), strict=True)
        ]
        if row["rmse_K"] is not None:
            tests = "1 test" if row["num_tests"] == 1 else f"{row['num_tests']} tests"
            minutes = row["duration_s"] / 60.0
            parts.append(f"<p>RMSE {row['rmse_K']:.2f} K over {tests}, {minutes:.0f} min.</p>")
        if heldout:
            parts.append(table(["held out", "RMSE", "inside the 95 % band"], heldout))
    own = findings(row)
    parts.append(findings_html(own) if own else message("note", "No findings."))
    motors, tests, held = (files(row, role) for role in ("motor", "calibration", "holdout"))
    if motors and tests:
        words = ["heatrun", "calibrate", motors[0], *tests, *(["--holdout", *held] if held else [])]
        parts.append(f"<p>By itself, with posterior and sheet: <code>"
                     f"{escape(' '.join(map(shlex.quote, words)))}</code></p>")  # fmt: skip
    return "".join(parts)


def _parameter_rows(row: Row, sister: Row | None) -> tuple[list[str], list[list[str]]]:
    head = ["parameter", "unit", "by its own tests (95 %)"]
    units = parameters([row])
    lines = {
        name: [name, printed_unit(units[name]), _ranged(*each)]
        for name, each in intervals(row).items()
    }
    if sister is not None:
        head += ["given its sisters (95 %)", "distance from its type"]
        for name, value, low, high, off in zip(
            sister["parameters"], sister["given_values"], sister["given_low_95"],
            sister["given_high_95"], sister["distance_sd"], strict=True,
        ):  # fmt: skip
            if name in lines:
                lines[name] += [_ranged(low, value, high), f"{off:+.1f} sd"]
    return head, [line for line in lines.values() if len(line) == len(head)]


def _why(row: Row, sister: Row | None) -> str:
    if sister is not None and sister["is_outlier"]:
        named = ", ".join(sister["different"]) or "no single parameter stands out"
        return f" (probability {sister['outlier_probability']:.2f}; different: {escape(named)})"
    return f": {escape(row['result'] or '')}" if row["result"] else ""


def _ranged(low: float, value: float, high: float) -> str:
    """Return a value with its interval, to two digits of its width; empty where it is not known."""
    if not all(map(math.isfinite, (low, value, high))):
        return ""
    width = max(high - low, abs(value) * 1e-6)
    return f"{format_value(value, width)[0]} ({format_interval((low, high), width)})"


def _strips(rows: Sequence[Row]) -> list[list[int]]:
    """Return for each machine low, middle and high of each parameter among those of its type."""
    said = [
        [] if row["status"] != "fitted" else
        [(name, *each) for name, each in intervals(row).items()]
        for row in rows
    ]  # fmt: skip
    middles: dict[tuple[str, str], list[float]] = {}
    for row, own in zip(rows, said, strict=True):
        for name, _, value, _ in own:
            middles.setdefault((row["type"], name), []).append(value)
    scales = {}
    for key, values in middles.items():
        centre = float(np.median(values))
        spread = 1.4826 * float(np.median(np.abs(np.array(values) - centre)))
        scales[key] = centre, spread or 0.01 * abs(centre) or 1.0
    found = []
    for row, own in zip(rows, said, strict=True):
        places: list[int] = []
        for name, *ends in own:
            centre, spread = scales[row["type"], name]
            shares = (np.array(ends) - centre) / (2.0 * ROOM * spread) + 0.5
            places += [round(STRIP * float(np.clip(share, 0.0, 1.0))) for share in shares]
        found.append(places)
    return found


def _number(value: float | None) -> float:
    return UNKNOWN if value is None else float(value)
