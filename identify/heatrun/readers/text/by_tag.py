"""Tables with a row for each sample of a tag, as historians and data bases export them, or with a
column of times before each of values.

Each tag becomes a column that is empty where it has no sample of that time; the channels are then
joined at the times of the readings (`heatrun.record.raster.at_own_rates`).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd

from ...errors import InputError
from ...io.quantities import printable
from ...record.header import split_name
from ...record.table import Column, Stated, Table, on_all_times
from ...record.units import find_unit
from .quality import letters

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
