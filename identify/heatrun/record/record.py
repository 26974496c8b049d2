"""A bench test in memory: canonical channels on one time axis, and what was found about it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from msgspec import UNSET, UnsetType

Severity = Literal["error", "warning", "note"]

UnitSource = Literal["stated", "name", "assumed", "derived"]
"""How a unit is known: written for it as a unit, part of the column's name, or neither."""


@dataclass(frozen=True)
class Finding:
    """One statement about a record, made by a check or a reader; nothing is repaired for it.

    Attributes:
        id: Stable short name of the check, such as `"time_backwards"`.
        severity: `"error"` forbids a fit, `"warning"` puts a doubt on it, `"note"` informs.
        message: What was expected, what came (with unit).
        where: Test, channel and time span or row, in words; may be empty.
        remedy: What to do about it; may be empty.
        test: Name of the record, empty if the finding concerns none in particular.
        values: Figures behind the message by name with unit suffix, for `--json`; None for one
            that was not finite, where the finding was read back.
        network: Name of the network that it is about, unset if it is about none in particular.
    """

    id: str
    severity: Severity
    message: str
    where: str = ""
    remedy: str = ""
    test: str = ""
    values: Mapping[str, int | float | None] = field(default_factory=dict)
    network: str | UnsetType = UNSET

    def sentence(self) -> str:
        """Return the finding as one line of text."""
        head = f"{self.where}: " if self.where else ""
        return f"{head}{self.message} {self.remedy}".strip()


@dataclass(frozen=True)
class Source:
    """A file that a record was read from.

    Attributes:
        path: As the user gave it.
        sha256: Hex digest of the file's bytes as they lie on disk.
        reader: Which reader read it, with what it sniffed ("CSV, ';', decimal comma, UTF-8").
    """

    path: str
    sha256: str
    reader: str = ""


@dataclass(frozen=True)
class ColumnReading:
    """How one column of a file became a channel, or how a channel was derived.

    Attributes:
        channel: Canonical name.
        column: Name of the column in the file; empty for a derived channel.
        unit: Symbol of the unit that the values were read in.
        unit_from: How that unit is known.
        found_by: What says that the column is this channel: `"[columns]"`, `"canonical name"` or
            the name of a built-in map.
        file: The file, as the user gave it.
    """

    channel: str
    column: str
    unit: str
    unit_from: UnitSource
    found_by: str
    file: str


@dataclass(frozen=True)
class Record:
    """One bench test on one time axis.

    Attributes:
        name: Name of the test, by default the file's stem.
        channels: Canonical channel name (see `heatrun.record.channels`) to float64 array,
            shape (time,). `time_s` is always there; NaN marks a sample that the file does not have.
        sources: The files behind it.
        notes: Sentences on what was mapped, converted or derived, in order.
        findings: What the readers found, before any check ran.
        unused: Columns of the files that were not mapped to a channel.
        mapping: How each column of the files became a channel, in the order of the mapping.
        start: Day on which it began, ISO 8601; empty where the file does not say it.
        start_from: What of the file says so: `"clock of the record"` or `"header of the file"`.
        stretch: The part of the files that this is, as it is written behind a file; empty for all.
        first_row: Row that it begins with, where it was cut by rows; 0 where it was not.
        part_of: Name of the test that this is one of several parts of; empty for a test as a whole.
        decided: Channels whose unit the motor file itself gives; a line that repeats the heading of
            a column, as `heatrun init` writes it, decides nothing.
        clock_s: Time of the day at which the file's times are 0, where these are dates [s].
        masks: Windows whose readings are left out of the comparison, first and last time [s].
    """

    name: str
    channels: Mapping[str, np.ndarray]
    sources: tuple[Source, ...] = ()
    notes: tuple[str, ...] = ()
    findings: tuple[Finding, ...] = ()
    unused: tuple[str, ...] = ()
    mapping: tuple[ColumnReading, ...] = ()
    start: str = ""
    start_from: str = ""
    stretch: str = ""
    first_row: int = 0
    part_of: str = ""
    masks: tuple[tuple[float, float], ...] = ()
    decided: frozenset[str] = frozenset()
    clock_s: float | None = None

    def __getitem__(self, channel: str) -> np.ndarray:
        return self.channels[channel]

    def __contains__(self, channel: str) -> bool:
        return channel in self.channels

    @property
    def time_s(self) -> np.ndarray:
        """Time of each sample [s], shape (time,)."""
        return self.channels["time_s"]

    @property
    def duration_s(self) -> float:
        """Span between the first and the last sample [s]."""
        return float(self.time_s[-1] - self.time_s[0])
