"""What a person may choose between before a motor file is drafted: a column for each channel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from .bench.channels.schema import CHANNEL, REQUIRED
from .bench.free_columns import FreeColumn
from .bench.record import ColumnReading
from .bench.survey import Survey
from .io.quantities import printed_unit
from .motor_gaps import LONGEST_LINE, Gap, gaps

NONE = "none"
"""Right-hand side that leaves a channel out."""


@dataclass(frozen=True)
class Choice:
    """A channel, and what of the files it may be.

    Attributes:
        channel: Canonical name.
        sides: Right-hand sides of `[columns]` with what each holds, the proposed one first.
        is_proposed: The first one holds unless a person says otherwise.
    """

    channel: str
    sides: Mapping[str, str]
    is_proposed: bool


def choices(surveys: Sequence[Survey]) -> tuple[Choice, ...]:
    """Return the channels that are read, missing or likely, those of a calibration first.

    Args:
        surveys: What the files hold.
    """
    missing = {gap.channel: gap for gap in gaps(surveys) if gap.channel}
    free = {column.name: column for one in surveys for column in one.free if not column.text}
    recognised = [each for one in surveys for each in one.recognised if each.column]
    found = []
    for name in (*REQUIRED, *(name for name in CHANNEL if name not in REQUIRED)):
        gap = missing.get(name)
        read = {
            e.column: f"read in {printed_unit(e.unit)}" for e in recognised if e.channel == name
        }
        alike = {
            _as_read(e): f"read as {e.channel}"
            for e in recognised
            if e.channel != name and CHANNEL[e.channel].quantity == CHANNEL[name].quantity
        }
        offered = dict(gap.candidates) if gap else {}
        best = {side: offered.get(side, "") for side in gap.best} if gap else {}
        lines = {_line(name, column): column.shown() for column in free.values()}
        likely = {p.line: column.shown() for column in free.values() for p in column.proposals
                  if p.channel == name and p.is_likely}  # fmt: skip
        if gap or read or likely:
            sides = {**best, **read, **offered, **likely, **lines, **alike} | offered
            sides.pop("", None)
            found += [Choice(name, sides, bool(best or read))] if sides else []
    return tuple(found)


def _line(channel: str, column: FreeColumn) -> str:
    """Return how a column would be the channel; empty where unit or name say that it is not."""
    own = next((p.line for p in column.proposals if p.channel == channel), "")
    is_open = not column.unit and not any(p.is_likely for p in column.proposals)
    line = own or (f"{column.name} [{CHANNEL[channel].unit}]" if is_open else "")
    return line if len(line) <= LONGEST_LINE else ""


def _as_read(reading: ColumnReading) -> str:
    is_assumed = reading.unit_from == "assumed"
    return f"{reading.column} [{reading.unit}]" if is_assumed else reading.column


def as_chosen(found: Sequence[Gap], columns: Mapping[str, str]) -> tuple[Gap, ...]:
    """Return the gaps of tests as a person has filled them.

    Args:
        found: What the tests leave out.
        columns: Right-hand side by channel, also of channels that the tests do not leave out.
    """
    known = {gap.channel: gap for gap in found}
    return (
        *(_filled(gap, columns.get(gap.channel)) for gap in found),
        *(_filled(Gap(name, "", ""), side) for name, side in columns.items() if name not in known),
    )


def _filled(gap: Gap, side: str | None) -> Gap:
    if side is None:
        return gap
    others = {line: note for line, note in gap.candidates if line != side}
    note = dict(gap.candidates).get(side) or "chosen by hand"
    if side == NONE and gap.sentence:  # nothing is read for it anyway
        return replace(gap, best=())
    candidates = ((side, note), *others.items())
    return replace(gap, candidates=candidates, best=(side,), of_tests={}, is_of_some=False)
