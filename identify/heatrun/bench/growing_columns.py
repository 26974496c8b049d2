"""Columns that grow: what was handed out stays as it is, and a row costs the same however many
there are.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

FIRST_ROWS = 1024


class GrowingColumns:
    """Columns of one length to which rows are added.

    The arrays that `views` hands out are never written to again: further rows go behind them, or
    into arrays of twice the size.
    """

    def __init__(self, columns: Mapping[str, np.ndarray]) -> None:
        self._num_rows = len(next(iter(columns.values()))) if columns else 0
        self._held = {name: self._with_room(values) for name, values in columns.items()}

    @property
    def num_rows(self) -> int:
        """How many rows there are."""
        return self._num_rows

    @property
    def num_bytes(self) -> int:
        """Memory that they take [byte]."""
        return sum(held.nbytes for held in self._held.values())

    def add(self, rows: Mapping[str, np.ndarray], num_rows: int) -> None:
        """Add rows.

        Args:
            rows: By column, shape (new,); a column that is not there gets NaN.
            num_rows: How many.
        """
        end = self._num_rows + num_rows
        for name, held in self._held.items():
            if end > held.size:
                held = self._held[name] = self._with_room(held[: self._num_rows], end)
            held[self._num_rows : end] = rows.get(name, np.nan)
        self._num_rows = end

    def views(self) -> dict[str, np.ndarray]:
        """Return the columns as they are now, shape (row,) each."""
        found = {name: held[: self._num_rows] for name, held in self._held.items()}
        for view in found.values():
            view.flags.writeable = False
        return found

    @staticmethod
    def _with_room(values: np.ndarray, least: int = FIRST_ROWS) -> np.ndarray:
        room = np.full(max(2 * values.size, 2 * least), np.nan)
        room[: values.size] = values
        return room
