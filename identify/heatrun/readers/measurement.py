"""Measurement files: many channels in groups of different rates, of which few are needed.

What is needed follows from the names alone, so it is decided before a value is read.
"""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence, Set
from dataclasses import dataclass, replace

import numpy as np

from ..record.channels import Columns, columns_named, lines_of
from ..record.header import split_name
from ..record.record import Finding, UnitSource
from ..record.table import Column, Stated, Table


@dataclass(frozen=True)
class StoredChannel:
    """One channel of a measurement file, not yet read."""

    name: str  # As it stands in the file.
    group: str  # Group that holds it.
    unit: str | None  # Unit text of the file, or None.
    key: tuple[int, int] | str  # Where the reader finds it.
    text: str = ""  # What it holds instead of numbers ("text"), empty for numbers.
    # Why its numbers are not read, with the remedy; None if they are.
    refusal: tuple[str, str] | None = None


@dataclass(frozen=True)
class Series:
    """The samples of one channel."""

    values: np.ndarray  # Float64, NaN where invalid, shape (time,).
    # Times from the start of the measurement [s], shape (time,); None if the file gives none.
    time_s: np.ndarray | None


@dataclass(frozen=True)
class Measurement:
    """An open measurement file."""

    channels: tuple[StoredChannel, ...]  # Everything that it holds, without the channels of time.
    # From channels to their series, in the same order; called for what is needed only.
    read: Callable[[Sequence[StoredChannel]], list[Series]]
    reader: str  # Format and version.
    start: str = ""  # When the measurement began, as the file says it, or empty.
    time_names: tuple[str, ...] = ()  # Names that the channels of time have in the file.
    findings: tuple[Finding, ...] = ()  # Doubts about the file.
    time_unit_from: UnitSource = "stated"  # How it is known that the times are seconds.


@dataclass(frozen=True)
class Header:
    """The columns of a measurement, by the names under which `[columns]` can ask for them."""

    channels: Mapping[str, StoredChannel]  # Column name to the channel behind it; numbers only.
    texts: Mapping[str, str]  # Column name to what it holds instead of numbers.
    # The column of time, its values not yet known; None if the file gives no times.
    time: Column | None

    def table(
        self,
        size: int,
        values: Mapping[str, np.ndarray] | None = None,
        zeros: Set[str] = frozenset(),
        time_s: np.ndarray | None = None,
    ) -> Table:
        """Return a table of so many rows in which a column without values holds a placeholder.

        Which column becomes which channel depends on the names and, for some, on whether a column
        holds anything but zeros. Placeholders say both without a value being read.
        """
        blank = {True: np.broadcast_to(0.0, (size,)), False: np.broadcast_to(1.0, (size,))}
        columns = []
        if self.time is not None:
            columns.append(replace(self.time, values=blank[False] if time_s is None else time_s))
        for name, stored in self.channels.items():
            label, unit = split_name(stored.name)
            samples = (values or {}).get(name, blank[name in zeros])
            beside = (Stated(stored.unit, "the unit beside it"),) if stored.unit else ()
            unit = unit or stored.unit
            columns.append(Column(name, label, unit, samples, beside=beside, heading=stored.name))
        return Table(tuple(columns), self.texts)


def header_of(measurement: Measurement, columns: Columns) -> Header:
    """Return the names under which a measurement's channels can be asked for.

    A name that occurs once is its own; one that occurs in several groups becomes `group/name`, as
    does a name that `[columns]` writes so.
    """
    named = [part for _, text in lines_of(columns) for part in columns_named(text)]
    asked = {split_name(text)[0] for text in named} | set(named)
    counts = Counter(stored.name for stored in measurement.channels)
    times = [text.strip() for name, text in lines_of(columns) if name == "time_s"]
    claimed = {*times, *(split_name(text)[0] for text in times)} - {""}
    clocks = (name for name in measurement.time_names if claimed & {name, split_name(name)[0]})
    time = next(clocks, "time_s")
    note = f"seconds from {measurement.start}" if measurement.start else ""
    channels: dict[str, StoredChannel] = {}
    texts: dict[str, str] = {}
    for stored in measurement.channels:
        qualified = f"{stored.group}/{stored.name}"
        is_plain = counts[stored.name] == 1 and qualified not in asked and stored.name != time
        name = stored.name if is_plain else qualified
        number = 1
        while name in channels or name in texts:
            number += 1
            name = f"{qualified}#{number}"
        if stored.text:
            texts[name] = stored.text
        else:
            channels[name] = stored
    known_from, start = measurement.time_unit_from, measurement.start
    clock = Column(time, split_name(time)[0], "s", np.ones(1), note, is_clock=True,
                   unit_from=known_from, start=start)  # fmt: skip
    return Header(channels, texts, clock)
