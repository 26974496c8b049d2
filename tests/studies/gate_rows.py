"""Rows of Markdown tables: measured shares against their gates, with their 95 % limits."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.stats import beta


def limits_95(count: int, num: int) -> tuple[float, float]:
    """Return the 95 % limits of a share [1].

    Reference: C. J. Clopper, E. S. Pearson, The use of confidence or fiducial limits illustrated in
        the case of the binomial, Biometrika 26 (1934) 404-413.
    """
    low = float(beta.ppf(0.025, count, num - count + 1)) if count else 0.0
    high = float(beta.ppf(0.975, count + 1, num - count)) if count < num else 1.0
    return low, high


def percent_95(count: int, num: int) -> str:
    return "{:.0f}…{:.0f} %".format(*(100 * limit for limit in limits_95(count, num)))


def heads(row: str) -> list[str]:
    """Return the two lines that a table begins with, of the names between bars."""
    return [f"| {row} |".replace("|  |", "| |"), "|---" * (row.count("|") + 1) + "|"]


def at_most(what: str, most: float, cases: Sequence[bool]) -> str:
    return _share(what, f"≤ {100 * most:.0f} %", cases, lambda share: share <= most)


def at_least(what: str, least: float, cases: Sequence[bool]) -> str:
    return _share(what, f"≥ {100 * least:.0f} %", cases, lambda share: share >= least)


def _share(what: str, gate: str, cases: Sequence[bool], holds: Any) -> str:
    if not cases:
        return f"| {what} | {gate} | – | – | – |"
    count, num = sum(cases), len(cases)
    mark = "met" if all(map(holds, limits_95(count, num))) else "met, too few cases to show it"
    mark = mark if holds(count / num) else "**missed**"
    share = f"{100 * count / num:.1f} % ({count} of {num})"
    return f"| {what} | {gate} | {share} | {percent_95(count, num)} | {mark} |"


def covered(what: str, inside: Sequence[bool]) -> str:
    if not inside:
        return f"| {what} | 93…97 % | – | – | – |"
    count, num = sum(inside), len(inside)
    low, high = limits_95(count, num)
    is_chance = low <= 0.97 and high >= 0.93
    mark = "outside, within what so few can show" if is_chance else "**outside**"
    mark = "met" if 0.93 <= count / num <= 0.97 else mark
    share = f"{100 * count / num:.1f} % ({count} of {num})"
    return f"| {what} | 93…97 % | {share} | {percent_95(count, num)} | {mark} |"


def figure(what: str, gate: str, values: Sequence[float], reduce: Any) -> str:
    """Return the row of one figure of many values against a gate such as `"≤ 2"`."""
    if not len(values):
        return f"| {what} | {gate} | – | – | – |"
    value, limit = float(reduce(values)), float(gate.split()[1])
    holds = value <= limit if gate.startswith("≤") else value >= limit
    mark = "met" if holds else "**missed**"
    return f"| {what} | {gate} | {value:.2f} ({len(values)} cases) | – | {mark} |"


def in_band(
    what: str,
    rows: Sequence[dict[str, Any]],
    key: str = "holdout_coverage_95",
    wanted: tuple[float, float] = (90.0, 98.0),
) -> str:
    """Return the row of held-out readings inside their 95 % band; `wanted` are limits [%]."""
    low, high = wanted
    if not rows:
        return f"| {what} | {low:.0f}…{high:.0f} % | – | – | – |"
    found = np.array([row[key] for row in rows])
    mean, error = 100.0 * found.mean(), 196.0 * found.std() / np.sqrt(found.size)
    is_chance = mean - error <= high and mean + error >= low
    mark = "**missed**, within chance" if is_chance else "**missed**"
    mark = "met" if low <= mean <= high else mark
    below = f"{100 * np.mean(found < 0.85):.0f} % of the tests below 85 %"
    return (
        f"| {what} | {low:.0f}…{high:.0f} % | mean {mean:.1f} %, {below} | "
        f"{mean - error:.0f}…{min(mean + error, 100.0):.0f} % | {mark} |"
    )


def covers(row: dict[str, Any], name: str) -> bool:
    """Return whether a parameter is in its 95 % interval."""
    low, high = row["interval_95"][name]
    return low <= row["truth"][name] <= high


def is_far(row: dict[str, Any], name: str) -> bool:
    """Return whether a parameter is more than 3 of its standard deviations off."""
    return abs(row["value"][name] - row["truth"][name]) > 3.0 * row["sd"][name]


def rms(errors: Any) -> Any:
    return np.sqrt(np.mean(np.square(errors), axis=0))


def times_better(
    alone: np.ndarray, pooled: np.ndarray, least: float
) -> tuple[float, float, float, str]:
    """Return the RMS of errors over that of others, its 95 % limits, and whether it is enough.

    The limits are those of a bootstrap over the machines, shape (machine,) each.
    """
    ratio = float(rms(alone) / rms(pooled))
    picks = np.random.default_rng(0).integers(len(alone), size=(2000, len(alone)))
    low, high = np.quantile(rms(alone[picks].T) / rms(pooled[picks].T), [0.025, 0.975])
    mark = "met" if low >= least else "met, too few cases to show it"
    return ratio, low, high, mark if ratio >= least else "**missed**"
