"""Which column became which channel, in which unit, and how that is known: as data and as text."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from ..record import ColumnReading, Record
from .by_resistance import by_resistance
from .derive import constants_of, formulas
from .schema import CHANNEL

KNOWN_BY = {
    "stated": "stated",
    "name": "the name",
    "assumed": "ASSUMED",
    "derived": "derived",
}
"""How a unit is known, in words."""

HEAD = ("channel", "column", "unit", "unit known by", "column known by")
LONGEST = 36
KEPT = 17
"""Letters of a name that a line of the terminal or the sheet has room for, and from its start."""


class Read(Protocol):
    """A test of which it is known how its columns were read."""

    @property
    def name(self) -> str:
        """Its name."""
        ...

    @property
    def mapping(self) -> Sequence[ColumnReading]:
        """From `describe_mapping`; may be empty."""
        ...


@dataclass(frozen=True)
class ReadColumns:
    """How the columns of a test were read.

    Attributes:
        name: The test.
        mapping: From `describe_mapping`.
    """

    name: str
    mapping: list[ColumnReading]


def describe_mapping(record: Record) -> list[ColumnReading]:
    """Return how each channel of a record came about, derived ones too.

    Args:
        record: Any record; one that was made in memory has no columns.

    Returns:
        By channel; `found_by` says who says that it is this channel, or holds the formula.
    """
    if not record.mapping:
        return []
    read = {one.channel for one in record.mapping}
    derived = formulas(record.channels, read | constants_of(record.notes))
    if by_resistance(record):
        derived = {"winding_degC": "R(T), see the notes", **derived}
    if "time_s" not in read:
        derived = {"time_s": "sampling rate", **derived}
    more = [
        ColumnReading(name, "", CHANNEL[name].unit, "derived", formula, "")
        for name, formula in derived.items()
    ]
    return sorted([*record.mapping, *more], key=lambda row: _position(row.channel))


def describe_columns(record: Record) -> ReadColumns:
    """Return how the columns of a record were read, as `mapping_text` takes it."""
    return ReadColumns(record.name, describe_mapping(record))


def mapping_rows(mapping: Sequence[ColumnReading]) -> list[list[str]]:
    """Return the rows of a table under `HEAD`; names too long for it are cut.

    Args:
        mapping: From `describe_mapping`.
    """
    return [
        [
            row.channel,
            _cut(row.column) or "–",
            row.unit,
            KNOWN_BY[row.unit_from],
            _cut(row.found_by) if row.column else row.found_by,
        ]
        for row in mapping
    ]


def mapping_text(tests: Sequence[Read]) -> str:
    """Return aligned tables of columns and channels; tests that were read alike share one.

    Args:
        tests: Such as the tests of `fit.json`.
    """
    blocks = []
    for names, rows in grouped(tests):
        widths = [max(len(line[i]) for line in (HEAD, *rows)) for i in range(len(HEAD) - 1)]
        lines = [f"Columns of {names}"]
        for line in (HEAD, *rows):
            cells = [cell.ljust(width) for cell, width in zip(line, (*widths, 0), strict=True)]
            lines.append("  " + "  ".join(cells).rstrip())
        assumed = [row[0] for row in rows if row[3] == KNOWN_BY["assumed"]]
        if assumed:
            lines.append(f"  {assumption(assumed)}")
        blocks.append("\n".join(lines))
    return "\n".join(blocks)


def grouped(tests: Sequence[Read]) -> list[tuple[str, list[list[str]]]]:
    """Return names of tests that were read alike, with the rows of their table.

    Args:
        tests: As `mapping_text`; those without a mapping are left out.
    """
    alike: dict[str, tuple[list[str], list[list[str]]]] = {}
    for test in tests:
        rows = mapping_rows(test.mapping)
        if rows:
            alike.setdefault(repr(rows), ([], rows))[0].append(test.name)
    return [(", ".join(names), rows) for names, rows in alike.values()]


def assumption(channels: Sequence[str]) -> str:
    """Return the sentence on units that nothing said."""
    return (
        f"Unit assumed for {', '.join(channels)}: no file and no name gives it. State it in "
        "[columns] if you know it."
    )


def _position(channel: str) -> int:
    return list(CHANNEL).index(channel) if channel in CHANNEL else len(CHANNEL)


def _cut(text: str) -> str:
    clean = "".join(c if c.isprintable() else "?" for c in text)
    # Names of one system begin alike and often end alike: the middle goes.
    return clean if len(clean) <= LONGEST else f"{clean[:KEPT]}…{clean[KEPT + 1 - LONGEST :]}"
