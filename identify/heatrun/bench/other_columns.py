"""The columns of a file that no channel claims, for whoever wants to look at them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .readers.read import read_raw
from .readers.table import Table
from .readers.text.missing_rows import with_missing_rows
from .record import Record


@dataclass(frozen=True)
class Other:
    """A column of numbers that is no channel.

    Attributes:
        values: As they stand in the file, shape (time,).
        unit: Unit text of the file, or empty.
    """

    values: np.ndarray
    unit: str = ""


def other_columns(path: Path, record: Record) -> dict[str, Other]:
    """Return the columns of numbers of a file that are no channel, by name.

    Args:
        path: The file that the record was read from.
        record: The test; columns that are not on its time axis are left out.

    Raises:
        InputError: If the file cannot be read.
    """
    return others_of(read_raw(path), record)


def others_of(table: Table, record: Record) -> dict[str, Other]:
    """Return the columns of numbers of a table that are no channel, by name.

    Args:
        table: What was read of the file.
        record: The test that was made of it.
    """
    held: Mapping[str, np.ndarray] = {
        column.name: column.values for column in table.columns if column.name in record.unused
    }
    if table.num_rows < record.time_s.size and table.sample_numbers is not None and held:
        held = with_missing_rows(held, table.sample_numbers)
    units = {column.name: column.unit or "" for column in table.columns}
    return {
        name: Other(values, units[name])
        for name, values in held.items()
        if values.size == record.time_s.size and np.isfinite(values).any()
    }
