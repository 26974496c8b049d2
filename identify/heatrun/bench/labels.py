"""Finding columns by their label, with or without a unit at its end."""

from __future__ import annotations

from collections.abc import Iterable

from .schema import CHANNEL, Channel
from .table import Column
from .units import find_unit

SHORTEST_WORD = 2
"""Up to this length a label is a symbol, and case matters: t is a time, T a temperature."""


def columns_of(label: str, channel: str, pool: Iterable[Column]) -> list[Column]:
    """Return the columns of a label, as written or else without regard to case.

    Args:
        label: Column name without its unit.
        channel: Canonical name whose units may end the name ("torque_Nm"), or any other text.
        pool: The columns to look through.
    """
    pool = tuple(pool)
    exact = [column for column in pool if label in _forms(column, channel)]
    if exact or len(label) <= SHORTEST_WORD:
        return exact
    folded = label.casefold()
    return [
        column for column in pool if folded in (form.casefold() for form in _forms(column, channel))
    ]


def _forms(column: Column, channel: str) -> tuple[str, ...]:
    """Return the label of a column with and without a unit at its end ("torque_Nm")."""
    if channel in CHANNEL and (unit := suffix_unit(column.label, CHANNEL[channel])):
        return column.label, column.label[: -len(unit) - 1]
    return (column.label,)


def suffix_unit(label: str, channel: Channel) -> str | None:
    """Return the unit of the channel's quantity that a label ends in, or None.

    Args:
        label: Such as `"torque_Nm"`.
        channel: The channel that the column is to become.
    """
    for position, sign in enumerate(label):
        if sign == "_" and position and find_unit(label[position + 1 :], channel.quantity):
            return label[position + 1 :]
    return None
