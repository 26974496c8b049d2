"""What a reader returns: the columns of one file under the names that stand in it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from ...errors import InputError
from ..record import Finding, UnitSource


@dataclass(frozen=True)
class Question:
    """What a file leaves open about a column; a column that is used must have none.

    Attributes:
        problem: What the values may be, with figures for each reading.
        answers: Right-hand sides of `[columns]` of which each settles it.
        remedy: What to do where `[columns]` cannot settle it.
    """

    problem: str
    answers: tuple[str, ...] = ()
    remedy: str = ""

    def asked(self, channel: str, where: str) -> InputError:
        """Return the question as the error that ends the reading.

        Args:
            channel: What the column is to become.
            where: File and column.
        """
        lines = " or ".join(f'{channel} = "{answer}"' for answer in self.answers)
        remedy = f"Say which in the motor file: [columns] {lines}." if lines else self.remedy
        return InputError(self.problem, where=where, remedy=remedy)


@dataclass(frozen=True)
class Stated:
    """A unit that a file gives somewhere else than in the name of a column.

    Attributes:
        text: Unit text; of scope "kind" the word for an amplitude.
        source: Where it stands, such as `"the row of units"`, for messages.
        scope: What it is about: this column, every column of its quantity, something that is not
            clear, or the kind of a current alone: that it is an amplitude.
    """

    text: str
    source: str
    scope: Literal["column", "quantity", "unclear", "kind"] = "column"


@dataclass(frozen=True)
class Column:
    """One column of a bench file, not yet a channel.

    Attributes:
        name: As it stands in the file, with any unit.
        label: The name without its unit.
        unit: Unit text that the file gives, or None.
        values: Float64, shape (time,), in that unit; NaN where the file has no number.
        note: How values that were no plain numbers were read (clock times, dates), or empty.
        beside: Units that the file gives outside of the name.
        heading: What stands over the column where `name` is made of more than that, or empty.
        is_clock: The reader made seconds of what the file holds, whatever unit it gives.
        unit_from: How the reader knew that unit, for a clock alone.
        question: What must be answered before the column is used, or None.
        start: Of times, when they begin as the file says it, ISO 8601; empty where it does not.
    """

    name: str
    label: str
    unit: str | None
    values: np.ndarray
    note: str = ""
    beside: tuple[Stated, ...] = ()
    heading: str = ""
    is_clock: bool = False
    unit_from: UnitSource = "stated"
    question: Question | None = None
    start: str = ""

    @property
    def is_seconds(self) -> bool:
        """Whether the values are seconds already: clock times, dates, times of a recording."""
        return self.is_clock or bool(self.note and self.unit == "s")


@dataclass(frozen=True)
class Table:
    """The columns of one bench file.

    Attributes:
        columns: In the order of the file; all of one length.
        text_columns: Columns without a single number, with the first thing that stands in them.
        constants: Scalars of the file by name, in the file's unit.
        notes: Preamble lines and what the reader did, in order.
        findings: What the reader could not use, with line numbers.
        reader: Format and what was sniffed: "CSV, ';', decimal comma, UTF-8".
        sample_numbers: Which sample each row is, from 0, shape (time,), where lines without a
            sample stand between the rows; None where every line is a row.
    """

    columns: tuple[Column, ...]
    text_columns: Mapping[str, str] = field(default_factory=dict)
    constants: Mapping[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    findings: tuple[Finding, ...] = ()
    reader: str = ""
    sample_numbers: np.ndarray | None = None

    @property
    def num_rows(self) -> int:
        """Number of samples; 0 if there is no column."""
        return self.columns[0].values.size if self.columns else 0


PREAMBLE = "Preamble: "
"""How a note begins that holds a line above the table."""


def preamble_of(notes: Sequence[str]) -> tuple[str, ...]:
    """Return the lines above the table that stand among the notes of a reader."""
    return tuple(note.removeprefix(PREAMBLE) for note in notes if note.startswith(PREAMBLE))
