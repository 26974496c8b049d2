"""Lines of the motor file that a finding advises: what of a test to use, and what to leave out."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from ..io.toml_text import table_header
from ..record.record import Finding, Record
from ..record.stretch import windows as stretches

MOST_WINDOWS = 8
"""More of them are no fault of a moment, and nobody types them."""


def section_of(record: Record) -> str:
    """Return the section of the motor file that says which parts of a record are used."""
    return table_header("tests", record.part_of or record.name)


def use_line(record: Record, *windows: tuple[float, float]) -> str:
    """Return the line that uses stretches, first and last time [s], of a record, each as a test.

    A part that stands in rows of its test, for a clock that was set back, is cut in rows.
    """
    key = "use_rows" if record.first_row else "use"
    if record.first_row:
        time_s = record.time_s
        at = [np.flatnonzero((time_s >= low) & (time_s <= high)) for low, high in windows]
        ends = [record.first_row + rows[[0, -1]] for rows in at if rows.size]
        pairs = [f"[{first}, {last}]" for first, last in ends]
    else:
        pairs = [f"[{low:.3f}, {high:.3f}]" for low, high in windows]
    if not pairs:
        rows = f"[{record.first_row}, {record.first_row + record.time_s.size - 1}]"
        return f"take {rows} out of {section_of(record)} {key} in the motor file"
    pairs += ["…"] if record.part_of else []
    others = " (… the other parts)" if record.part_of else ""
    return f"{section_of(record)} {key} = [{', '.join(pairs)}] in the motor file{others}"


def mask_line(record: Record, windows: Sequence[tuple[float, float]]) -> str:
    """Return the line that leaves readings out of the comparison; from the start on, one that
    begins the test behind them.

    Windows are first and last times [s] in order; those that are left out already come with them.
    """
    time_s = record.time_s[np.isfinite(record.time_s)]
    if record.first_row:  # its times stand in other parts too
        is_left = np.any([(time_s >= low) & (time_s <= high) for low, high in windows], axis=0)
        return use_line(record, *stretches(time_s, ~is_left))
    first, last = windows[0]
    if first <= time_s[0]:
        later = time_s[time_s > last]
        if later.size and len(windows) == 1:
            return use_line(record, (float(later[0]), float(time_s[-1])))
    # a key stands once in its section: what is left out already belongs to the line
    windows = sorted({*record.masks, *windows})
    return f"{section_of(record)} mask = {windows_text(windows)} in the motor file"


def windows_text(windows: Sequence[tuple[float, float]]) -> str:
    """Return windows [s], in order, as the motor file has them, widened to tenths of a second."""
    if len(windows) > MOST_WINDOWS:
        return "[[FROM, UNTIL], …]"
    tenths = [(math.floor(10.0 * low), math.ceil(10.0 * high)) for low, high in windows]
    pairs = ", ".join(
        # a window of one sample has two ends too
        f"[{low / 10.0:.1f}, {max(high, low + 1) / 10.0:.1f}]"
        for low, high in tenths
    )
    return f"[{pairs}]"


LINE = re.compile(
    r"(?P<key>\[tests\.(?:\"[^\"]*\"|[^\]]*)\] (?:use|use_rows|mask|bridge)) = "
    r"\[(?P<windows>\[[0-9., \[\]]+\])(?P<open>, …)?\] in the motor file(?: \(… the other parts\))?"
)
"""A line that a finding advises."""

Windows = list[tuple[str, str]]


def in_one_line(findings: Iterable[Finding]) -> list[Finding]:
    """Return findings of which those that advise one key of a section advise one line for all.

    A key stands once in its section: parts that are used are what all leave of them, readings that
    are left out those of all.
    """
    findings = list(findings)
    advised: dict[str, tuple[Windows, bool]] = {}
    for line in itertools.chain(*(LINE.finditer(one.remedy) for one in findings)):
        new = re.findall(r"\[([0-9.]+), ([0-9.]+)\]", line["windows"]), bool(line["open"])
        old = advised.get(line["key"])
        advised[line["key"]] = _both(line["key"], old, new) if old else new

    def written(line: re.Match[str]) -> str:
        windows, is_open = advised[line["key"]]
        pairs = [f"[{low}, {high}]" for low, high in windows] + ["…"] * is_open
        others = " (… the other parts)" if is_open else ""
        return f"{line['key']} = [{', '.join(pairs)}] in the motor file{others}"

    return [replace(one, remedy=LINE.sub(written, one.remedy)) for one in findings]


def _both(key: str, one: tuple[Windows, bool], other: tuple[Windows, bool]) -> tuple[Windows, bool]:
    """Return the windows, as they are written, that two lines make together."""
    if not key.rpartition(" ")[2].startswith("use"):
        windows = sorted({*one[0], *other[0]}, key=lambda window: float(window[0]))
        return windows, False
    kept: Windows = []
    for (mine, _), (theirs, is_open) in ((one, other), (other, one)):
        for low, high in mine:
            ends = [(max(low, a, key=float), min(high, b, key=float)) for a, b in theirs]
            met = [(a, b) for a, b in ends if float(a) <= float(b)]
            # what stands for all other parts leaves them as they are
            kept += met or [(low, high)] * is_open
    return sorted(set(kept), key=lambda window: float(window[0])), one[1] and other[1]
