"""A bench test in memory: canonical channels on one time axis, and what was found about it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from msgspec import UNSET, UnsetType

Severity = Literal["error", "warning", "note"]

UnitSource = Literal["stated", "name", "assumed", "derived"]
"""How a unit is known: written for it as a unit, part of the column's name, or neither."""


@dataclass(frozen=True)
class Finding:
    """One statement about a record, made by a check or a reader; nothing is repaired for it."""

    id: str  # Stable short name of the check, such as `"time_backwards"`.
    severity: Severity  # `"error"` forbids a fit, `"warning"` puts a doubt on it, `"note"` informs.
    message: str  # What was expected, what came (with unit).
    where: str = ""  # Test, channel and time span or row, in words; may be empty.
    remedy: str = ""  # What to do about it; may be empty.
    test: str = ""  # Name of the record, empty if the finding concerns none in particular.
    # Figures behind the message by name with unit suffix, for `--json`; None for one that was not
    # finite, where the finding was read back.
    values: Mapping[str, int | float | None] = field(default_factory=dict)
    # Name of the network that it is about, unset if it is about none in particular.
    network: str | UnsetType = UNSET

    def sentence(self) -> str:
        """Return the finding as one line of text."""
        head = f"{self.where}: " if self.where else ""
        return f"{head}{self.message} {self.remedy}".strip()


@dataclass(frozen=True)
class Source:
    """A file that a record was read from."""

    path: str  # As the user gave it.
    sha256: str  # Hex digest of the file's bytes as they lie on disk.
    # Which reader read it, with what it sniffed ("CSV, ';', decimal comma, UTF-8").
    reader: str = ""


@dataclass(frozen=True)
class ColumnReading:
    """How one column of a file became a channel, or how a channel was derived."""

    channel: str  # Canonical name.
    column: str  # Name of the column in the file; empty for a derived channel.
    unit: str  # Symbol of the unit that the values were read in.
    unit_from: UnitSource  # How that unit is known.
    # What says that the column is this channel: `"[columns]"`, `"canonical name"` or the name of a
    # built-in map.
    found_by: str
    file: str  # The file, as the user gave it.


@dataclass(frozen=True)
class Record:
    """One bench test on one time axis."""

    name: str  # Name of the test, by default the file's stem.
    # Canonical channel name (see `heatrun.record.channels`) to float64 array, shape (time,).
    # `time_s` is always there; NaN marks a sample that the file does not have.
    channels: Mapping[str, np.ndarray]
    sources: tuple[Source, ...] = ()  # The files behind it.
    notes: tuple[str, ...] = ()  # Sentences on what was mapped, converted or derived, in order.
    findings: tuple[Finding, ...] = ()  # What the readers found, before any check ran.
    unused: tuple[str, ...] = ()  # Columns of the files that were not mapped to a channel.
    # How each column of the files became a channel, in the order of the mapping.
    mapping: tuple[ColumnReading, ...] = ()
    start: str = ""  # Day on which it began, ISO 8601; empty where the file does not say it.
    # What of the file says so: `"clock of the record"` or `"header of the file"`.
    start_from: str = ""
    # The part of the files that this is, as it is written behind a file; empty for all.
    stretch: str = ""
    first_row: int = 0  # Row that it begins with, where it was cut by rows; 0 where it was not.
    # Name of the test that this is one of several parts of; empty for a test as a whole.
    part_of: str = ""
    # Windows whose readings are left out of the comparison, first and last time [s].
    masks: tuple[tuple[float, float], ...] = ()
    # Channels whose unit the motor file itself gives; a line that repeats the heading of a column,
    # as `heatrun init` writes it, decides nothing.
    decided: frozenset[str] = frozenset()
    # Time of the day at which the file's times are 0, where these are dates [s].
    clock_s: float | None = None

    def __getitem__(self, channel: str) -> np.ndarray:
        return self.channels[channel]

    def __contains__(self, channel: str) -> bool:
        return channel in self.channels

    def having(self, channels: Mapping[str, np.ndarray], note: str = "", **changes: Any) -> Record:
        """Return the record with channels beside its own, or in their place, a note on that, and
        other fields that change.
        """
        notes = (*self.notes, note) if note else self.notes
        return replace(self, channels={**self.channels, **channels}, notes=notes, **changes)

    def without(self, *names: str) -> Record:
        """Return the record without some channels."""
        kept = {name: values for name, values in self.channels.items() if name not in names}
        return replace(self, channels=kept)

    def read_of(self, channel: str) -> ColumnReading | None:
        """Return how a channel was read, None if it was not, or that is not known."""
        return next((one for one in self.mapping if one.channel == channel), None)

    def column_of(self, channel: str, otherwise: str = "") -> str:
        """Return the column of the file that became a channel, or what stands in for it."""
        read = self.read_of(channel)
        return otherwise if read is None else read.column

    @property
    def time_s(self) -> np.ndarray:
        """Time of each sample [s], shape (time,)."""
        return self.channels["time_s"]

    @property
    def duration_s(self) -> float:
        """Span between the first and the last sample [s]."""
        return float(self.time_s[-1] - self.time_s[0])
