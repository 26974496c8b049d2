"""Columns of one name told apart: the second is called `NAME #2`."""

from __future__ import annotations

from dataclasses import replace

from .table import Table


def told_apart(table: Table) -> Table:
    """Return a table in which no two columns have one name, with a note on each new name.

    A line of `[columns]` can then name either of them. What stands over a column, and with it its
    unit, stays as it is; so two columns that would be read by their name remain a question.

    Args:
        table: What a reader returned.
    """
    taken = {column.name for column in table.columns}
    seen: set[str] = set()
    columns, notes = [], []
    for column in table.columns:
        if column.name not in seen:
            seen.add(column.name)
            columns.append(column)
            continue
        number = 2
        while (name := f"{column.name} #{number}") in taken:
            number += 1
        taken.add(name)
        notes.append(f"Two columns are called '{column.name}': the later one is named '{name}'.")
        columns.append(replace(column, name=name, heading=column.heading or column.name))
    return replace(table, columns=tuple(columns), notes=(*table.notes, *notes))
