"""Rows of the benchmark: measured in turns, held against a target, printed as a table."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from importlib.util import find_spec

import jax
import numpy as np


@dataclass(frozen=True)
class Row:
    """One line of the table."""

    section: str  # Table that it stands in.
    what: str  # What was measured.
    value: float  # The figure.
    unit: str  # Its unit.
    target: float | None = None  # What it should not exceed, or None.
    detail: str = ""  # Where the figure comes from.

    @property
    def missed(self) -> bool:
        return self.target is not None and self.value > self.target


def needs(package: str) -> Callable[[Callable], Callable]:
    """Let a function return None, and say so, where a package is not installed."""

    def of(function: Callable) -> Callable:
        @wraps(function)
        def called(*given):
            if find_spec(package) is not None:
                return function(*given)
            print(f"{package} is not there: skipped")
            return None

        return called

    return of


def seconds(call: Callable) -> float:
    """Return how long one call takes [s], with all that it computes."""
    begin = time.perf_counter()
    jax.block_until_ready(call())
    return time.perf_counter() - begin


def median(call: Callable, repeats: int) -> float:
    """Return the median time of a call [s] after one that does not count."""
    seconds(call)
    return float(np.median([seconds(call) for _ in range(repeats)]))


def in_turns(first: Callable, second: Callable, repeats: int) -> np.ndarray:
    """Return the times of two calls that take turns [s], shape (repeat, 2)."""
    seconds(first)
    seconds(second)
    return np.array([[seconds(call) for call in (first, second)] for _ in range(repeats)])


def ratio_row(
    section: str,
    what: str,
    first: Callable,
    second: Callable,
    repeats: int,
    target: float | None = None,
) -> Row:
    """Return the row of a ratio measured in turns: its median, and that of the fastest turns.

    Where others use the machine, what runs on all cores loses more than what runs on one; the
    fastest turns are the quiet ones.
    """
    times = in_turns(first, second, repeats)
    ratio = times[:, 0] / times[:, 1]
    low, high = np.quantile(ratio, [0.25, 0.75])
    a, b = np.median(times, axis=0)
    quiet = np.divide(*np.min(times, axis=0))
    detail = f"{duration(a)} / {duration(b)}, ± {0.5 * (high - low):.2g}; fastest {quiet:.2f}"
    return Row(section, what, float(np.median(ratio)), "1", target, detail)


def duration(value: float) -> str:
    """Return a time [s] with a fitting unit."""
    for limit, factor, unit in ((1e-3, 1e6, "µs"), (1.0, 1e3, "ms"), (300.0, 1.0, "s")):
        if value < limit:
            return f"{factor * value:.3g} {unit}"
    return f"{value / 60:.3g} min" if value < 7200 else f"{value / 3600:.3g} h"


def figure(value: float, unit: str) -> str:
    """Return a figure with its unit as the table prints it."""
    if unit == "s":
        return duration(value)
    return f"{value:.3g}" + ("" if unit == "1" else f" {unit}")


def markdown(rows: list[Row]) -> str:
    """Return one table per section."""
    parts = []
    for section in dict.fromkeys(row.section for row in rows):
        lines = [
            f"## {section}\n",
            "| what | measured | from | target | |",
            "|---|---|---|---|---|",
        ]
        for row in (row for row in rows if row.section == section):
            target = "" if row.target is None else f"≤ {figure(row.target, row.unit)}"
            verdict = "" if row.target is None else "met"
            if row.missed and row.target is not None:
                verdict = f"**MISSED by {100 * (row.value / row.target - 1):.0f} %**"
            measured = figure(row.value, row.unit)
            lines.append(f"| {row.what} | {measured} | {row.detail} | {target} | {verdict} |")
        parts.append("\n".join(lines))
    return "\n\n".join(parts)
