"""Columns of one name told apart: they are called `NAME #1`, `NAME #2` and so on."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np

from .table import Column, Table


def told_apart(table: Table) -> Table:
    """Return a table in which no two columns have one name, with a note on the new names.

    A line of `[columns]` can then name each of them; the name that they share stays a question,
    also to a line of `[columns]`. What stands over a column, and with it its unit, stays as it is.

    Args:
        table: What a reader returned.
    """
    table = _without_repeats(table)
    counts = Counter(column.name for column in table.columns)
    shared = {name: number for name, number in counts.items() if number > 1}
    if not shared:
        return table
    taken = set(counts)
    named: dict[str, list[str]] = {name: [] for name in shared}
    columns = []
    for column in table.columns:
        if column.name not in shared:
            columns.append(column)
            continue
        number = len(named[column.name]) + 1
        while (name := f"{column.name} #{number}") in taken:
            number += 1
        taken.add(name)
        named[column.name].append(name)
        columns.append(replace(column, name=name, heading=column.heading or column.name))
    notes = tuple(
        f"{shared[name]} columns are called '{name}'; in [columns] they are "
        f"{', '.join(repr(one) for one in names)}."
        for name, names in named.items()
    )
    return replace(table, columns=tuple(columns), notes=(*table.notes, *notes))


def _without_repeats(table: Table) -> Table:
    """Leave out columns that repeat another one, name and numbers, such as a time by channel."""
    kept: list[Column] = []
    for column in table.columns:
        same = (one for one in kept if one.name == column.name)
        if not any(np.array_equal(one.values, column.values, equal_nan=True) for one in same):
            kept.append(column)
    if len(kept) == len(table.columns):
        return table
    count = len(table.columns) - len(kept)
    note = f"{count} columns repeat another one of the same name and are left out."
    return replace(table, columns=tuple(kept), notes=(*table.notes, note))
