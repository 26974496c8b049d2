"""What historians and data bases export: tables with a row for each sample of a tag, or with a
column of times before each of values, and variables that say of readings whether they are good.

Each tag becomes a column that is empty where it has no sample of that time; the channels are then
joined at the times of the readings (`heatrun.record.raster.at_own_rates`). A reading that is not
marked as good counts as missing, whatever the format, as do those that a measurement file
invalidates.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd

from ..errors import InputError
from ..io.quantities import printable
from ..record.header import split_name
from ..record.record import Finding
from ..record.table import Column, Stated, Table, on_all_times
from ..record.units import find_unit
from .labels import names_time

TIMES = frozenset(("time", "timestamp", "datetime", "ts", "zeit", "zeitstempel", "timestring"))
TAGS = frozenset(
    ("tag", "tagname", "field", "signal", "signalname", "channel", "channelname", "variable",
     "variablename", "parameter", "sensor", "point", "pointname", "metric", "varname")
)  # fmt: skip
VALUES = frozenset(("value", "val", "wert", "valore", "valeur", "valor", "varvalue"))
UNITS = frozenset(("unit", "units", "engunits", "einheit", "uom"))
"""Names of the columns of such a table, in lower case and letters alone."""

FEWEST_SAMPLES = 3
"""So many rows has a tag in the mean; below it the words may be remarks."""


def by_tag(table: Table, cells: dict[str, pd.Series], where: str) -> Table:
    """Return a table with a column for each tag, any other table as it is.

    `cells` are those of the file by the name of their column.

    Raises:
        InputError: If a tag has two values at one time.
    """
    times, values = _named(TIMES, table), _named(VALUES, table)
    tagged = [name for name in table.text_columns if letters(name) in TAGS]
    if not (len(times) == len(values) == len(tagged) == 1):
        return table
    (time,), (value,), (tag,) = times, values, tagged
    codes, tags = pd.factorize(cells[tag].astype(str).str.strip())
    if not 2 <= len(tags) <= codes.size / FEWEST_SAMPLES:
        return table
    is_known = np.isfinite(time.values) & np.isfinite(value.values)
    moments, rows = np.unique(time.values[is_known], return_inverse=True)
    grid = np.full((moments.size, len(tags)), np.nan)
    grid[rows, codes[is_known]] = value.values[is_known]
    again = grid[rows, codes[is_known]] != value.values[is_known]
    if again.any():
        raise InputError(
            f"The table has a row for each sample of a tag, and '{tags[codes[is_known][again][0]]}'"
            " has two values at one time.",
            where=where,
            remedy="Export one motor and one test alone, or a column for each tag.",
        )
    unit = next((cells[name] for name in table.text_columns if letters(name) in UNITS), None)
    columns = [replace(time, values=moments, start=time.start if moments[0] == 0.0 else "")]
    for code, name in enumerate(map(printable, map(str, tags))):
        label, said = split_name(name)
        given = "" if unit is None else str(unit[codes == code].iloc[0]).strip()
        beside = (Stated(given, f"the column '{unit.name}'"),) if unit is not None and given else ()
        columns.append(Column(name, label, said or given or None, grid[:, code],
                              value.note, beside, question=value.question))  # fmt: skip
    others = [name for name in (*(one.name for one in table.columns), *table.text_columns)
              if name not in (time.name, value.name, tag)]  # fmt: skip
    unused = f" Not used: {', '.join(others)}." if others else ""
    note = f"A row for each sample of a tag: each '{tag}' is read as a column.{unused}"
    # a table for each tag, one below the other, has its header again above each
    findings = tuple(one for one in table.findings if one.id != "logger_restarted")
    return replace(table, columns=tuple(columns), text_columns={}, sample_numbers=None,
                   is_by_tag=True, findings=findings, notes=(*table.notes, note))  # fmt: skip


def by_clock(table: Table) -> Table:
    """Return a table of pairs, a time and a value, with one time; any other table as it is."""
    clocks, values = table.columns[::2], table.columns[1::2]
    same = {(one.name, one.unit, one.start) for one in clocks}
    times = [one.values[np.isfinite(one.values)] for one in clocks]
    if (
        not len(clocks) == len(values) > 1 == len(same)
        or find_unit(clocks[0].unit or "", "time") is None
        or any((np.diff(one) <= 0.0).any() for one in times)
        or all(np.array_equal(one, times[0]) for one in times)
    ):
        return table
    known = [
        one.values[np.isfinite(clock.values)] for clock, one in zip(clocks, values, strict=True)
    ]
    moments, spread = on_all_times(times, known)
    columns = [replace(clocks[0], values=moments)]
    columns += [replace(one, values=each) for one, each in zip(values, spread, strict=True)]
    note = f"Each column is read by the '{clocks[0].name}' to its left."
    return replace(table, columns=tuple(columns), sample_numbers=None, is_by_tag=True,
                   notes=(*table.notes, note))  # fmt: skip


def _named(names: frozenset[str], table: Table) -> list[Column]:
    return [column for column in table.columns if letters(column.label) in names]


GOOD = r"(?:good|ok|valid|gut|gültig|buon[oa]|valid[oaei]|bonn?e?)\b.*"
NOT_GOOD = (
    r"(?:bad|uncertain|questionable|invalid|not (?:good|valid)|schlecht|ungültig|unsicher|"
    r"non (?:valid|buon)[oae]|cattiv[oa]|incert[oaei]|mauvaise?|invalide|douteu(?:x|se))\b.*"
)
"""Cells of a variable of marks, in lower case: each is one of them, and few are empty."""

IS_QUALITY = re.compile(r"quality|statuscode|qualität|qualità|qualité")
IS_INVALID = re.compile(r"invalid(?:ity)?|ungültig|non?[\s_]?valido?")
IS_VALID = re.compile(r"validity|valido?|gültig")
IS_STATE = re.compile("|".join(
    (IS_QUALITY.pattern, IS_INVALID.pattern, IS_VALID.pattern, "status|state")
))  # fmt: skip
"""Words of the names of such variables: of codes of the quality, of 1 for invalid, of 1 for valid,
and of all of them."""

UA_NOT_GOOD, DA_GOOD, DA_MOST = 2**30, 192, 255
"""Codes of OPC: UA marks good as 0 and what is not from the first on, DA what is below the second.
"""


LONGEST_MARK = 40
"""Letters of a mark or a tag in the mean at most; where texts are longer, they are remarks."""


@dataclass(frozen=True)
class Variable:
    """A variable of a file, as it stands there and as it was read."""

    name: str  # As it stands in the file.
    # What the file holds, text or numbers, shape (time,); None if it is no course.
    cells: pd.Series | np.ndarray | None
    # The numbers that were read, along one axis as long; None if there are none.
    values: np.ndarray | None = None
    is_time: bool = False  # Whether they are times, which no mark takes away.


def without_bad(
    variables: Sequence[Variable],
    where: str,
    *,
    lines: np.ndarray | None = None,
    is_ordered: bool = True,
) -> tuple[dict[int, np.ndarray], frozenset[int], list[Finding]]:
    """Leave out the readings of a file, of which all variables are given, that are not good.

    Where variables are ordered, one of marks stands behind the one that it marks. Messages count
    the lines of a text table by their numbers, shape (time,), else rows from 1. What comes back are
    the values of those that lose readings, NaN there, which variables are marks, and the findings.
    """
    found = {i: bad for i, one in enumerate(variables) if (bad := _not_good(one)) is not None}
    kept: dict[int, np.ndarray] = {}
    findings = []
    read = {
        i: one.values
        for i, one in enumerate(variables)
        if one.values is not None and i not in found and not one.is_time
    }
    for place, bad in found.items():
        alike = {i: values for i, values in read.items() if bad.size in values.shape}
        names = [one.name for one in variables]
        num_marks = sum(other.size == bad.size for other in found.values())
        marked = _marked(place, num_marks, names, alike, is_ordered=is_ordered)
        is_lost, lost = np.zeros_like(bad), []
        for i in marked:
            values = kept.get(i, alike[i])
            axes = [axis for axis, size in enumerate(values.shape) if size == bad.size]
            shape = [bad.size if axis == axes[0] else 1 for axis in range(values.ndim)]
            is_its = bad.reshape(shape) & np.isfinite(values)
            if is_its.any():
                kept[i] = np.where(is_its, np.nan, values)
                others = tuple(axis for axis in range(values.ndim) if axis != axes[0])
                is_lost, lost = is_lost | is_its.any(axis=others), [*lost, names[i]]
        if lost or (bad.any() and not marked):
            is_told = is_lost if lost else bad
            cells = pd.Series(np.asarray(variables[place].cells, dtype=object))
            mark = printable(str(cells[is_told].iloc[0])[:LONGEST_MARK])
            findings.append(_marks(names[place], mark, is_told, lost, where, lines))
    return kept, frozenset(found), findings


def columns_without_bad(
    held: Sequence[tuple[str, Any, Column | None]], where: str, lines: np.ndarray | None = None
) -> tuple[list[Column], list[Finding]]:
    """Return the columns of a table without the readings that are not good; as `without_bad`.

    Of each are given its name, its cells and, of numbers, what they were read as.
    """
    first = next((column for *_, column in held if column is not None), None)
    variables = [
        Variable(name, cells)
        if column is None
        else Variable(name, cells, column.values, is_time(column, is_first=column is first))
        for name, cells, column in held
    ]
    kept, _, findings = without_bad(variables, where, lines=lines)
    return [
        replace(column, values=kept.get(i, column.values))
        for i, (*_, column) in enumerate(held)
        if column is not None
    ], findings


def _marks(
    name: str, mark: str, bad: np.ndarray, lost: list[str], where: str, lines: np.ndarray | None
) -> Finding:
    count, first = int(bad.sum()), int(np.flatnonzero(bad)[0])
    line = first + 1 if lines is None else int(lines[first])
    then = "They count as missing."
    remedy = f"If they are good after all, export without '{name}'."
    if not lost:
        then = "No column is called so: none of its readings is left out."
        remedy = "Call it as the column that it marks with 'Quality' behind: 'T1', 'T1 Quality'."
    return Finding(
        "unreadable_cells",
        "warning",
        f"{count} of {bad.size} readings are marked as not good by '{name}'; the first mark is "
        f"'{mark}' in {'row' if lines is None else 'line'} {line}. {then}",
        f"{where}, column{'s' * (len(lost) > 1)} {', '.join(lost or [name])}",
        remedy,
        values={"count": count, "first_line": line},
    )


def is_time(column: Column, *, is_first: bool) -> bool:
    """Return whether a column holds times; the first one also if it only rises."""
    return (
        column.is_seconds
        or find_unit(column.unit or "", "time") is not None
        or names_time(column.name)
        or (is_first and bool(np.all(np.diff(column.values) > 0.0)))
    )


def _not_good(variable: Variable) -> np.ndarray | None:
    """Return which samples a variable marks as not good, None for one of no marks."""
    if variable.cells is None:
        return None
    cells, name = pd.Series(variable.cells), variable.name.casefold()
    if pd.api.types.is_bool_dtype(cells.dtype):
        cells = cells.astype(float)
    if pd.api.types.is_numeric_dtype(cells.dtype):
        return _not_good_codes(cells.to_numpy(dtype=float, na_value=np.nan), name)
    known = cells.drop_duplicates()
    said = known.astype(object).where(known.notna(), "").astype(str).str.strip().str.lower()
    is_empty, is_bad = said == "", said.str.fullmatch(NOT_GOOD)
    if not (is_empty | is_bad | said.str.fullmatch(GOOD)).all():
        return None
    if 2 * cells.isin(known[is_empty]).sum() > cells.size:  # remarks
        return None
    return cells.isin(known[is_bad]).to_numpy()


def _not_good_codes(codes: np.ndarray, name: str) -> np.ndarray | None:
    is_invalid, is_valid = IS_INVALID.search(name), IS_VALID.search(name)
    if not is_valid and not is_invalid and not IS_QUALITY.search(name):
        return None
    values = set(codes[np.isfinite(codes)].tolist())
    if is_invalid or is_valid:
        bad = 1.0 if is_invalid else 0.0
        return codes == bad if values <= {0.0, 1.0} else None
    if values and -UA_NOT_GOOD > min(values) >= -2 * UA_NOT_GOOD:  # its first bit is no sign
        codes = np.where(codes < 0.0, codes + 4 * UA_NOT_GOOD, codes)
        values = set(codes[np.isfinite(codes)].tolist())
    if not values or min(values) < 0.0:
        return None
    if min(values) == 0.0 and all(value >= UA_NOT_GOOD for value in values - {0.0}):
        return codes >= UA_NOT_GOOD
    return codes < DA_GOOD if DA_GOOD <= max(values) <= DA_MOST else None


def _marked(
    place: int,
    num_marks: int,
    names: Sequence[str],
    read: Mapping[int, np.ndarray],
    *,
    is_ordered: bool,
) -> list[int]:
    """Return the places of the variables that one marks."""
    stem = letters(IS_STATE.sub("", names[place].casefold()))
    called = [i for i in read if stem and stem in letters(names[i])]
    if len(called) == 1:
        return called
    if num_marks == 1:
        return list(read)
    return [place - 1] if is_ordered and place - 1 in read else []


def letters(name: str) -> str:
    """Return the letters and digits of a name alone, in lower case."""
    return re.sub(r"[\W_]", "", name.casefold())
