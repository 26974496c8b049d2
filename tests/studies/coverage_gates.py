"""What the rows of the coverage study say: coverage with its binomial limits, ranks, gates."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cache
from typing import Any

import numpy as np
from discovery_gates import limits_95
from scipy.stats import binom

Row = dict[str, Any]

NETWORK = ("Ceq_w", "Ceq_sr", "Req_w", "Req_sr")
TIMES = ("tau_winding", "tau_stator", "tau_fast", "tau_slow")
LEVELS = (0.5, 0.9, 0.95)
NOISE = ("noise_sd", "noise_time", "noise_white", "unmodelled_heat")
GROUPS = (NETWORK, TIMES, ("end",), NOISE)
"""Quantities whose rank histograms share an envelope."""

FEWEST = {"all": 400, "prior draws": 200}
"""Records wanted."""

MISSPECIFIED = ("slower noise", "stronger noise", "noise that doubles", "heavy tails")

NUM_BINS = 10
"""Bins of a rank histogram: 20 ranks each with 200 records."""

NUM_ENVELOPE = 20_000
"""Simulated histograms behind an envelope: its limits are then exact to a rank."""


def chosen(rows: Sequence[Row], cell: str, method: str) -> list[Row]:
    """Return the rows of a cell that a method was run on."""
    return [row for row in rows if row["cell"] == cell and method in row]


def rank(rows: Sequence[Row], method: str, quantity: str) -> np.ndarray:
    """Return the shares of the posterior below the truth, shape (row,)."""
    return np.array([row[method]["ranks"][quantity] for row in rows])


def coverage(ranks: np.ndarray, level: float) -> float:
    """Return how often the central interval of a level holds the truth [1]."""
    return float(np.mean(np.abs(ranks - 0.5) <= 0.5 * level))


def binomial_limits(share: float, num: int) -> tuple[float, float]:
    """Return the 95 % limits of a probability of which `share` was seen in `num` trials."""
    return limits_95(round(share * num), num)


def histogram(ranks: np.ndarray) -> np.ndarray:
    """Return the counts of ranks in equal bins."""
    return np.histogram(ranks, bins=NUM_BINS, range=(0.0, 1.0))[0]


@cache
def envelope(num: int, num_histograms: int) -> tuple[int, int]:
    """Return the limits that all bins of several histograms of uniform ranks keep in 95 %.

    The histograms count as independent, which makes the envelope a little wide if they are not.
    """
    rng = np.random.default_rng(0)
    shape = (NUM_ENVELOPE // num_histograms, num_histograms)
    counts = rng.multinomial(num, np.full(NUM_BINS, 1.0 / NUM_BINS), size=shape)
    lowest, highest = counts.min(axis=(1, 2)), counts.max(axis=(1, 2))
    for tail in np.linspace(0.025, 1e-5, 2000):
        low = int(binom.ppf(tail, num, 1.0 / NUM_BINS))
        high = int(binom.isf(tail, num, 1.0 / NUM_BINS))
        if np.mean((lowest >= low) & (highest <= high)) >= 0.95:
            return low, high
    raise ArithmeticError("no envelope found")


def is_inside(ranks: np.ndarray, num_histograms: int) -> bool:
    """Whether a histogram keeps inside the envelope of so many."""
    low, high = envelope(ranks.size, num_histograms)
    counts = histogram(ranks)
    return bool(np.all(counts >= low) and np.all(counts <= high))


def gates(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Return each gate with what was measured, its binomial limits and whether it holds."""
    found = []
    for cell, wanted in FEWEST.items():
        num = sum(cell in ("all", row["cell"]) for row in rows)
        found.append({
            "what": "records", "cell": cell, "wanted": f"≥ {wanted}", "measured": str(num),
            "limits": None, "cases": num, "holds": num >= wanted, "is_chance": False,
        })  # fmt: skip
    for cell in ("as declared", "exact instruments"):
        for method in ("laplace", "quick", "emcee"):
            mine = chosen(rows, cell, method)
            if mine:
                found += _parameters(mine, cell, method, 0.93, 0.97)
    for cell in MISSPECIFIED:
        for method in ("laplace", "quick"):
            mine = chosen(rows, cell, method)
            if mine:
                found += _parameters(mine, cell, method, 0.85, 1.0)
    drawn = chosen(rows, "prior draws", "quick")
    for group in GROUPS if drawn else ():
        found += [_histogram(rank(drawn, "quick", name), name, len(group)) for name in group]
    for cell in ("as declared", "exact instruments"):
        mine = chosen(rows, cell, "quick")
        if mine:
            shares = [row["quick"]["share_95"] for row in mine]
            found.append(_gate("30 s means of held-out tests inside the 95 % band", cell,
                               (0.90, 0.98), float(np.mean(shares)), len(mine),
                               _bootstrap(shares)))  # fmt: skip
    return found


def _histogram(ranks: np.ndarray, name: str, size: int) -> dict[str, Any]:
    counts = histogram(ranks)
    low, high = envelope(ranks.size, size)
    return {
        "what": f"rank histogram of {name}, quick",
        "cell": "prior draws",
        "wanted": f"bins of {low}…{high}",
        "measured": f"{counts.min()}…{counts.max()}",
        "limits": None,
        "cases": ranks.size,
        "holds": is_inside(ranks, size),
        "is_chance": False,
    }


def _parameters(
    rows: Sequence[Row], cell: str, method: str, low: float, high: float
) -> list[dict[str, Any]]:
    result = []
    for name in NETWORK:
        share = coverage(rank(rows, method, name), 0.95)
        result.append(_gate(f"95 % interval of {name}, {method}", cell, (low, high), share,
                            len(rows), binomial_limits(share, len(rows))))  # fmt: skip
    return result


def _gate(
    what: str,
    cell: str,
    wanted: tuple[float, float],
    share: float,
    num: int,
    limits: tuple[float, float],
) -> dict[str, Any]:
    low, high = wanted
    is_open = high >= 1.0
    return {
        "what": what,
        "cell": cell,
        "wanted": f"≥ {100 * low:.0f} %" if is_open else f"{100 * low:.0f}…{100 * high:.0f} %",
        "measured": f"{100 * share:.1f} %",
        "limits": f"{100 * limits[0]:.1f}…{100 * limits[1]:.1f} %",
        "cases": num,
        "holds": low <= share <= high,
        "is_chance": limits[0] <= high and limits[1] >= low,
    }


def _bootstrap(shares: Iterable[float]) -> tuple[float, float]:
    """Return 95 % limits of a mean over records, whose block means are not independent."""
    values = np.asarray(list(shares))
    rng = np.random.default_rng(0)
    means = values[rng.integers(values.size, size=(2000, values.size))].mean(axis=1)
    return float(np.quantile(means, 0.025)), float(np.quantile(means, 0.975))
