"""What historians and data bases export: tables with a row for each sample of a tag, or with a
column of times before each of values, and columns that say of readings whether they are good.

Each tag becomes a column that is empty where it has no sample of that time; the channels are then
joined at the times of the readings (`heatrun.record.raster.at_own_rates`). A reading that is not
marked as good counts as missing, as do those that a measurement file invalidates.
"""

from __future__ import annotations

import re
from collections.abc import Container, Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from ...errors import InputError
from ...io.quantities import printable
from ...record.header import split_name
from ...record.record import Finding
from ...record.table import Column, Stated, Table, on_all_times
from ...record.units import find_unit
from ..labels import names_time

TIMES = frozenset(("time", "timestamp", "datetime", "ts", "zeit", "zeitstempel"))
TAGS = frozenset(
    ("tag", "tagname", "field", "signal", "signalname", "channel", "channelname", "variable",
     "variablename", "parameter", "sensor", "point", "pointname", "metric")
)  # fmt: skip
VALUES = frozenset(("value", "val", "wert", "valore", "valeur", "valor"))
UNITS = frozenset(("unit", "units", "engunits", "einheit", "uom"))
"""Names of the columns of such a table, in lower case and letters alone."""

FEWEST_SAMPLES = 3
"""So many rows has a tag in the mean; below it the words may be remarks."""


def by_tag(table: Table, cells: dict[str, pd.Series], where: str) -> Table:
    """Return a table with a column for each tag, any other table as it is.

    Args:
        table: As read, with a column of times and one of values.
        cells: The cells of the file by the name of their column.
        where: The file, for messages.

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
    return replace(table, columns=tuple(columns), text_columns={}, sample_numbers=None,
                   is_by_tag=True, notes=(*table.notes, note))  # fmt: skip


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
"""Cells of a column of marks, in lower case: each is one of them, and few are empty."""

IS_QUALITY = re.compile(r"quality|statuscode|qualität|qualità|qualité")
IS_VALID = re.compile(r"validity|valid|gültig|valido")
IS_STATE = re.compile(rf"{IS_QUALITY.pattern}|{IS_VALID.pattern}|status|state")
"""Words of the names of such columns: of codes of the quality, of 1 for valid, and of both."""

UA_NOT_GOOD, DA_GOOD, DA_MOST = 2**30, 192, 255
"""Codes of OPC: UA marks good as 0 and what is not from the first on, DA what is below the second.
"""


def without_bad(
    columns: Sequence[Column],
    places: Sequence[int],
    frame: pd.DataFrame,
    names: Sequence[str],
    lines: np.ndarray,
    where: str,
) -> tuple[list[Column], list[Finding]]:
    """Return the columns of a table without the readings that it does not mark as good.

    Args:
        columns: As read.
        places: The place of each in the file.
        frame: The cells of the file.
        names: What stands above them.
        lines: Numbers of their lines, from 1, shape (time,).
        where: The file, for messages.
    """
    found = {place: _not_good(frame.iloc[:, place], name) for place, name in enumerate(names)}
    marks = {place: bad for place, bad in found.items() if bad is not None}
    kept, findings = list(columns), []
    read = {
        place: i
        for i, place in enumerate(places)
        if place not in marks and not _is_time(columns[i], is_first=i == 0)
    }
    for place, bad in marks.items():
        is_lost, lost = np.zeros_like(bad), []
        for i in _marked(place, len(marks), names, read):
            column = kept[read[i]]
            is_its = bad & np.isfinite(column.values)
            if is_its.any():
                kept[read[i]] = replace(column, values=np.where(bad, np.nan, column.values))
                is_lost, lost = is_lost | is_its, [*lost, column.name]
        if not lost:
            continue
        first, line = frame.iloc[:, place][is_lost].iloc[0], int(lines[is_lost][0])
        count = int(is_lost.sum())
        findings.append(
            Finding(
                id="unreadable_cells",
                severity="warning",
                message=f"{count} of {bad.size} readings are marked as not good by "
                f"'{names[place]}'; the first mark is '{printable(str(first)[:40])}' in line "
                f"{line}. They count as missing.",
                where=f"{where}, column{'s' * (len(lost) > 1)} {', '.join(lost)}",
                remedy=f"If they are good after all, export without '{names[place]}'.",
                values={"count": count, "first_line": line},
            )
        )
    return kept, findings


def _is_time(column: Column, *, is_first: bool) -> bool:
    return (
        column.is_seconds
        or find_unit(column.unit or "", "time") is not None
        or names_time(column.name)
        or (is_first and bool(np.all(np.diff(column.values) > 0.0)))
    )


def _not_good(cells: pd.Series, name: str) -> np.ndarray | None:
    """Return which samples a column marks as not good, None for a column of no marks."""
    if pd.api.types.is_bool_dtype(cells.dtype):
        return ~cells.to_numpy() if IS_VALID.search(name.casefold()) else None
    if pd.api.types.is_numeric_dtype(cells.dtype):
        return _not_good_codes(cells.to_numpy(dtype=float), name.casefold())
    texts = cells.astype(object).where(cells.notna(), "").astype(str).str.strip().str.lower()
    if 2 * np.sum(texts != "") < texts.size:  # remarks
        return None
    known = texts.drop_duplicates()
    bad = known[known.str.fullmatch(NOT_GOOD)]
    others = known[~known.isin(bad)]
    is_marks = (others.str.fullmatch(GOOD) | (others == "")).all()
    return texts.isin(bad).to_numpy() if is_marks else None


def _not_good_codes(codes: np.ndarray, name: str) -> np.ndarray | None:
    is_valid = IS_VALID.search(name)
    if not is_valid and not IS_QUALITY.search(name):
        return None
    values = set(codes[np.isfinite(codes)].tolist())
    if is_valid:
        return codes == 0.0 if values <= {0.0, 1.0} else None
    if not values or min(values) < 0.0:
        return None
    if min(values) == 0.0 and all(value >= UA_NOT_GOOD for value in values - {0.0}):
        return codes >= UA_NOT_GOOD
    return codes < DA_GOOD if DA_GOOD <= max(values) <= DA_MOST else None


def _marked(place: int, num_marks: int, names: Sequence[str], read: Container[int]) -> list[int]:
    """Return the places of the columns that a column marks."""
    stem = letters(IS_STATE.sub("", names[place].casefold()))
    called = [i for i, name in enumerate(names) if i in read and stem and stem in letters(name)]
    if len(called) == 1:
        return called
    if num_marks == 1:
        return [i for i, _ in enumerate(names) if i in read]
    return [place - 1] if place - 1 in read else []


def letters(name: str) -> str:
    """Return the letters and digits of a name alone, in lower case."""
    return re.sub(r"[\W_]", "", name.casefold())
