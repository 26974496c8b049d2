"""What a reader returns: the columns of one file under the names that stand in it.

Columns of one name are told apart as `NAME #1`, `NAME #2` and so on. Logs of raw bus frames (CAN,
LIN, FlexRay) hold bytes, of which a DBC makes signals; they are refused.
"""

import itertools
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from ..errors import InputError
from .record import Finding, UnitSource


@dataclass(frozen=True)
class Question:
    """What a file leaves open about a column; a column that is used must have none."""

    problem: str  # What the values may be, with figures for each reading.
    answers: tuple[str, ...] = ()  # Right-hand sides of `[columns]` of which each settles it.
    remedy: str = ""  # What to do where `[columns]` cannot settle it.

    def asked(self, channel: str, where: str) -> InputError:
        """Return the question as the error that ends the reading."""
        lines = " or ".join(f'{channel} = "{answer}"' for answer in self.answers)
        remedy = f"Say which in the motor file: [columns] {lines}." if lines else self.remedy
        return InputError(self.problem, where=where, remedy=remedy)


@dataclass(frozen=True)
class Stated:
    """A unit that a file gives somewhere else than in the name of a column."""

    text: str  # Unit text; of scope "kind" the word for an amplitude.
    source: str  # Where it stands, such as `"the row of units"`, for messages.
    # What it is about: this column, every column of its quantity, something that is not clear, or
    # the kind of a current alone: that it is an amplitude.
    scope: Literal["column", "quantity", "unclear", "kind"] = "column"

    @property
    def at_start(self) -> str:
        """The source as a sentence begins with it."""
        return f"{self.source[:1].upper()}{self.source[1:]}"


@dataclass(frozen=True)
class Column:
    """One column of a bench file, not yet a channel."""

    name: str  # As it stands in the file, with any unit.
    label: str  # The name without its unit.
    unit: str | None  # Unit text that the file gives, or None.
    values: np.ndarray  # Float64, shape (time,), in that unit; NaN where the file has no number.
    # How values that were no plain numbers were read (clock times, dates), or empty.
    note: str = ""
    beside: tuple[Stated, ...] = ()  # Units that the file gives outside of the name.
    # What stands over the column where `name` is made of more than that, or empty.
    heading: str = ""
    # The reader made seconds of what the file holds, whatever unit it gives.
    is_clock: bool = False
    unit_from: UnitSource = "stated"  # How the reader knew that unit, for a clock alone.
    question: Question | None = None  # What must be answered before the column is used, or None.
    # Of times, when they begin as the file says it, ISO 8601; empty where it does not.
    start: str = ""

    @property
    def is_seconds(self) -> bool:
        """Whether the values are seconds already: clock times, dates, times of a recording."""
        return self.is_clock or bool(self.note and self.unit == "s")


@dataclass(frozen=True)
class Table:
    """The columns of one bench file."""

    columns: tuple[Column, ...]  # In the order of the file; all of one length.
    # Columns without a single number, with the first thing that stands in them.
    text_columns: Mapping[str, str] = field(default_factory=dict)
    # Scalars of the file by name, in the file's unit.
    constants: Mapping[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()  # Preamble lines and what the reader did, in order.
    findings: tuple[Finding, ...] = ()  # What the reader could not use, with line numbers.
    reader: str = ""  # Format and what was sniffed: "CSV, ';', decimal comma, UTF-8".
    # Which sample each row is, from 0, shape (time,), where lines without a sample stand between
    # the rows; None where every line is a row.
    sample_numbers: np.ndarray | None = None
    # Each column has times of its own; its cells at those of others are empty.
    is_by_tag: bool = False

    @property
    def num_rows(self) -> int:
        """Number of samples; 0 if there is no column."""
        return self.columns[0].values.size if self.columns else 0


def on_all_times(
    times: Sequence[np.ndarray], columns: Sequence[np.ndarray]
) -> tuple[np.ndarray, list[np.ndarray]]:
    """Return all times that columns have, and the columns there, NaN at those of others.

    The times of each column increase, shape (sample,).
    """
    moments = np.unique(np.concatenate(times))
    spread = []
    for own, values in zip(times, columns, strict=True):
        spread.append(np.full(moments.size, np.nan))
        spread[-1][np.searchsorted(moments, own)] = values
    return moments, spread


PREAMBLE = "Preamble: "
"""How a note begins that holds a line above the table."""


def preamble_of(notes: Sequence[str]) -> tuple[str, ...]:
    """Return the lines above the table that stand among the notes of a reader."""
    return tuple(note.removeprefix(PREAMBLE) for note in notes if note.startswith(PREAMBLE))


def told_apart(table: Table) -> Table:
    """Return a table in which no two columns have one name, with a note on the new names.

    A line of `[columns]` can then name each of them; the name that they share stays a question,
    also to a line of `[columns]`. What stands over a column, and with it its unit, stays as it is.
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


BLF = b"LOGG"
"""First bytes of a log of Vector's binary format."""

FRAME_CHANNEL = re.compile(
    r"(?:CAN|LIN|FLX|ETH|MOST|K_LINE|USB)_\w*(?:Frame|Error|Message|Pdu|WakeUp|Spike)\w*(?:\..*)?"
)
"""Names that ASAM MDF, bus logging, gives to channels of frames."""

NUM_LINES = 200
BETWEEN = re.compile(r"[\s,;|]+")
LENGTH = re.compile(r"[\[(]?([0-9]{1,2})[\])]?")
BYTE = re.compile(r"(?:0x)?[0-9A-Fa-f]{2}")
BYTE_ALONE = re.compile(r"0[0-9A-Fa-f]|[0-9A-Fa-f]?[A-Fa-f][0-9A-Fa-f]?|0x..")
"""A byte that no number of a table is written as."""

FIRST_LINES = re.compile(r"base (?:hex|dec)\s+timestamps|;\$FILEVERSION=|\*+BUSMASTER")
"""Of ASC, TRC and BUSMASTER."""

CANDUMP = re.compile(r"^\(?[0-9.]+\)?\s+\w+\s+[0-9A-Fa-f]{3,8}##?[0-9A-Fa-fR]")
NAMES_OF_FRAMES = (
    frozenset(("id", "canid", "arbitrationid", "identifier", "messageid", "msgid", "frameid")),
    frozenset(("dlc", "len", "datalength", "databytes", "data", "data0", "d1", "byte0")),
)
"""A header of frames names one of each, in lower case and letters alone."""

REMEDY = (
    "Decode it with the DBC of the bus first. With asammdf, for an MDF: "
    "MDF('log.mf4').extract_bus_logging({'CAN': [('bus.dbc', 0)]}).save('signals.mf4'); any "
    "other log becomes one by python-can: can_logconvert LOG log.mf4. Then read signals.mf4."
)


def no_signals(kind: str, where: str) -> InputError:
    """Return the error for a log of frames."""
    return InputError(
        f"The file holds raw bus frames ({kind}), no signals.", where=where, remedy=REMEDY
    )


def kind_of_frames(text: str) -> str:
    """Return of what kind a log of frames is, empty for any other text."""
    filled = (line.strip() for line in text.splitlines()[: 5 * NUM_LINES])
    lines = list(itertools.islice((line for line in filled if line), NUM_LINES))
    for line in lines[:10]:
        names = {re.sub(r"[^a-z0-9]", "", name.casefold()) for name in re.split(r"[,;\t|]", line)}
        if len(names) > 2 and all(names & wanted for wanted in NAMES_OF_FRAMES):
            return "a table of frames"
    if any(FIRST_LINES.match(line) for line in lines[:10]):
        return "a log of a bus analyser"
    frames = sum(CANDUMP.match(line) is not None for line in lines)
    if 2 * frames > len(lines):
        return "candump"
    held = [data for line in lines if (data := _bytes_of(BETWEEN.split(line)))]
    is_hexadecimal = any(BYTE_ALONE.fullmatch(byte) for data in held for byte in data)
    return "bytes by line" if 2 * len(held) > len(lines) and is_hexadecimal else ""


def _bytes_of(cells: Sequence[str]) -> Sequence[str]:
    """Return the bytes of a line behind their number, as in "123 Rx d 3 00 1A FF"; or nothing."""
    for place, cell in enumerate(cells[1:], 1):
        length = LENGTH.fullmatch(cell)
        data = list(itertools.takewhile(BYTE.fullmatch, cells[place + 1 :]))
        if length and len(data) >= int(length[1]) > 1:
            return data[: int(length[1])]
    return ()
