"""Lines of the motor file that a finding advises: what of a test to use, and what to leave out."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from ..io.toml_text import table_header
from ..record.record import Finding, Record
from ..record.stretch import windows as stretches

MOST_WINDOWS, MOST_PARTS = 40, 8
"""Windows of a line, and parts of a test: more of them are no fault of a moment, and nobody copies
them."""

DECIMALS = {"use": 3, "use_rows": 0, "mask": 1, "bridge": 1}


@dataclass(frozen=True)
class MotorFileLine:
    """A line on windows of a test: what is used of it, or what is left out."""

    section: str  # Header of its section, such as `[tests.drive]`.
    key: str  # One of `DECIMALS`.
    windows: tuple[tuple[float, float], ...]  # First and last time [s], or row, of each.
    is_open: bool = False  # Whether what the other parts of the test use stands there too.

    def __str__(self) -> str:
        """Return it as a remedy has it."""
        n = DECIMALS[self.key]
        pairs = [f"[{low:.{n}f}, {high:.{n}f}]" for low, high in self.windows]
        listed = ", ".join(pairs + ["…"] * self.is_open)
        line = f"{self.section} {self.key} = [{listed}] in the motor file"
        return line + " (… the other parts)" * self.is_open

    def with_other(self, other: MotorFileLine) -> MotorFileLine:
        """Return the line that two of a key make: what both use, or what either leaves out."""
        windows = [*self.windows, *other.windows]
        if self.key.startswith("use"):
            windows = []
            for one, beside in ((self, other), (other, self)):
                for low, high in one.windows:
                    ends = [(max(low, a), min(high, b)) for a, b in beside.windows]
                    met = [(a, b) for a, b in ends if a <= b]
                    # what stands for all other parts leaves them as they are
                    windows += met or [(low, high)] * beside.is_open
        is_open = self.is_open and other.is_open
        return replace(self, windows=tuple(sorted({*windows})), is_open=is_open)


Part = MotorFileLine | str


class Remedy(str):
    """The remedy of a finding, with the words and lines that it is made of as its `parts`."""

    parts: tuple[Part, ...]

    def __new__(cls, *parts: Part) -> Remedy:
        """Join the parts."""
        remedy = super().__new__(cls, "".join(map(str, parts)))
        remedy.parts = parts
        return remedy


def in_one_line(findings: Sequence[Finding]) -> list[Finding]:
    """Return the findings of a record with one line for each key, which its section has once."""
    made = [f.remedy.parts if isinstance(f.remedy, Remedy) else (f.remedy,) for f in findings]
    lines = [part for part in itertools.chain(*made) if isinstance(part, MotorFileLine)]
    for_all: dict[Part, MotorFileLine] = {}
    for line in lines:
        of_key = (one for one in lines if one.key == line.key)
        for_all[line] = reduce(MotorFileLine.with_other, of_key)
    remedies = ("".join(str(for_all.get(part, part)) for part in parts) for parts in made)
    return [replace(f, remedy=one) for f, one in zip(findings, remedies, strict=True)]


def section_of(record: Record) -> str:
    """Return the section of the motor file that says which parts of a record are used."""
    return table_header("tests", record.part_of or record.name)


def exchange_line(record: Record, one: str, other: str) -> str:
    """Return what to write where two channels have each other's columns."""
    return (
        f'Write {one} = "{record.column_of(other, other)}" and '
        f'{other} = "{record.column_of(one, one)}" under [columns].'
    )


def use_line(record: Record, *windows: tuple[float, float]) -> Part:
    """Return the line that uses stretches, first and last time [s], of a record, each as a test.

    A part that stands in rows of its test, for a clock that was set back, is cut in rows.
    """
    section, is_open, row = section_of(record), bool(record.part_of), record.first_row
    if not row:
        return MotorFileLine(section, "use", windows, is_open)
    time_s = record.time_s
    at = [np.flatnonzero((time_s >= low) & (time_s <= high)) for low, high in windows]
    rows = tuple((row + int(one[0]), row + int(one[-1])) for one in at if one.size)
    if not rows:
        return f"take [{row}, {row + time_s.size - 1}] out of {section} use_rows in the motor file"
    return MotorFileLine(section, "use_rows", rows, is_open)


def mask_line(record: Record, windows: Sequence[tuple[float, float]]) -> Part:
    """Return the line that leaves readings out of the comparison; from the start on, one that
    begins the test behind them.

    Windows are first and last times [s] in order; those that are left out already come with them.
    """
    time_s = record.time_s[np.isfinite(record.time_s)]
    if record.first_row:  # its times stand in other parts too
        is_left = np.any([(time_s >= low) & (time_s <= high) for low, high in windows], axis=0)
        return use_line(record, *stretches(time_s, ~is_left))
    later = time_s[time_s > windows[0][1]]
    if windows[0][0] <= time_s[0] and later.size and len(windows) == 1:
        return use_line(record, (float(later[0]), float(time_s[-1])))
    # a key stands once in its section: what is left out already belongs to the line
    return widened(record, "mask", sorted({*record.masks, *windows}))


def widened(record: Record, key: str, windows: Sequence[tuple[float, float]]) -> Part:
    """Return the line for windows [s], in order, widened to tenths of a second."""
    if len(windows) > MOST_WINDOWS:
        return f"{section_of(record)} {key} = [[FROM, UNTIL], …] in the motor file"
    tenths = [(math.floor(10.0 * low), math.ceil(10.0 * high)) for low, high in windows]
    # a window of one sample has two ends too
    ends = tuple((low / 10.0, max(high, low + 1) / 10.0) for low, high in tenths)
    return MotorFileLine(section_of(record), key, ends)
