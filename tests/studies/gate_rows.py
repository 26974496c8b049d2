"""Rows of a table that hold a measured share against its gate, with its 95 % limits."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from discovery_gates import limits_95


def at_most(what: str, most: float, cases: Sequence[bool]) -> str:
    """Return the row of a share that may be so large at most [1]."""
    if not cases:
        return f"| {what} | ≤ {100 * most:.0f} % | – | – | – |"
    count, num = sum(cases), len(cases)
    low, high = limits_95(count, num)
    mark = "met" if high <= most else "met, too few cases to show it"
    mark = mark if count <= most * num else "**missed**"
    return (
        f"| {what} | ≤ {100 * most:.0f} % | {100 * count / num:.1f} % ({count} of {num}) | "
        f"{100 * low:.0f}…{100 * high:.0f} % | {mark} |"
    )


def at_least(what: str, least: float, cases: Sequence[bool]) -> str:
    """Return the row of a share that must be so large at least [1]."""
    if not cases:
        return f"| {what} | ≥ {100 * least:.0f} % | – | – | – |"
    count, num = sum(cases), len(cases)
    low, high = limits_95(count, num)
    mark = "met" if low >= least else "met, too few cases to show it"
    mark = mark if count >= least * num else "**missed**"
    return (
        f"| {what} | ≥ {100 * least:.0f} % | {100 * count / num:.1f} % ({count} of {num}) | "
        f"{100 * low:.0f}…{100 * high:.0f} % | {mark} |"
    )


def in_band(what: str, rows: Sequence[dict[str, Any]]) -> str:
    """Return the row of held-out readings inside their 95 % band."""
    if not rows:
        return f"| {what} | 90…98 % | – | – | – |"
    found = np.array([row["holdout_coverage_95"] for row in rows])
    mean, error = 100.0 * found.mean(), 196.0 * found.std() / np.sqrt(found.size)
    mark = "met" if 90.0 <= mean <= 98.0 else "**missed**"
    return (
        f"| {what} | 90…98 % | mean {mean:.1f} %, {100 * np.mean(found < 0.85):.0f} % of the tests "
        f"below 85 % | {mean - error:.0f}…{min(mean + error, 100.0):.0f} % | {mark} |"
    )
