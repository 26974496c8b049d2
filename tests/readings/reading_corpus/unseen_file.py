"""How the unseen files are laid down: a heat run under the names and units that a case gives it."""

from collections.abc import Callable
from dataclasses import replace
from datetime import datetime, timedelta
from typing import Any

import numpy as np

from .case import Case, Truth
from .table import Column, Layout, Sheet, sheet
from .units import FIVE

CAUSE = "unseen"
START = datetime(2024, 5, 3, 10, 12, 0)
"""When the recordings begin."""

SHORT = {"peak": "A_peak", "F": "degF", "R": "degR", "d°C": "0.1 degC", "1/s": "rps", "l/h": "L/h",
         "kpm": "kgf m"}  # fmt: skip
"""How units are called here; "-" is the canonical one."""


def made(
    number: int,
    heads: str = "",
    units: str = "",
    *,
    channels: tuple[str, ...] = FIVE,
    rows: int = 160,
    step_s: float = 5.0,
    digits: dict[str, int] | None = None,
    clock: Callable[[float], str] | None = None,
    written_s: float = 0.0,
    shift_s: float = 0.0,
) -> Sheet:
    """Return a heat run as columns, as `sheet`.

    Names stand between `|`, units between blanks or, where one holds a blank, between `|`; by
    default they are canonical. The clock writes the time as a cell.
    """
    names = heads.split("|") if heads else channels
    keys = (units.split("|") if "|" in units else units.split()) or ["-"] * len(channels)
    return sheet(
        number, rows=rows, step_s=step_s, channels=channels,
        headers=dict(zip(channels, names, strict=True)), decimals=digits,
        units={c: SHORT.get(k, k) for c, k in zip(channels, keys, strict=True) if k != "-"},
        cells={"time_s": clock} if clock else {}, written_s=written_s, shift_s=shift_s,
    )  # fmt: skip


def unseen(
    name: str, truth: Truth, made: Sheet, content: Any = None, *, mapped: bool = True, **more: Any
) -> Case:
    """Return a case; `mapped` puts the names of its columns into `[columns]`."""
    if mapped:
        more.setdefault("columns", {column.channel: column.header for column in made.columns})
    return made.case(CAUSE, name, truth, content, **more)


def comma(made: Sheet) -> Sheet:
    """Return the same with decimal commas."""
    return made.with_cells("*", lambda cell: cell.replace(".", ","))


def stamp(form: str) -> Callable[[float], str]:
    """Return what writes a time as a date in a form of `strftime`."""
    return lambda value: (START + timedelta(seconds=float(value))).strftime(form)


def changed(made: Sheet, change: Callable[[int, list[str]], list[str]]) -> Layout:
    """Return a layout whose rows are changed, given their number and cells."""
    return Layout(rows=lambda lines: [
        ",".join(change(i, line.split(","))) for i, line in enumerate(lines)
    ])  # fmt: skip


def beside(made: Sheet, header: str, cells: Callable[[int], str], at: int = 99) -> Sheet:
    """Return the same with a column that is none of the channels."""
    count = len(made.columns[0].cells)
    extra = Column("", header, tuple(cells(i) for i in range(count)), np.arange(count), "-")
    columns = list(made.columns)
    columns.insert(at, extra)
    return replace(made, columns=tuple(columns))


def names_of(made: Sheet) -> dict[str, str]:
    """Return the `[columns]` of the channels alone."""
    return {column.channel: column.header for column in made.columns if column.channel}
