"""What the rows of the coverage study say: coverage with its binomial limits, ranks, gates."""

from collections.abc import Sequence
from functools import cache

import numpy as np
from gate_rows import at_least, covered, in_band
from scipy.stats import binom
from study_runs import Row

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
    return [row for row in rows if row["cell"] == cell and method in row]


def rank(rows: Sequence[Row], method: str, quantity: str) -> np.ndarray:
    """Return the shares of the posterior below the truth, shape (row,)."""
    return np.array([row[method]["ranks"][quantity] for row in rows])


def coverage(ranks: np.ndarray, level: float) -> float:
    return float(np.mean(np.abs(ranks - 0.5) <= 0.5 * level))


def histogram(ranks: np.ndarray) -> np.ndarray:
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
    low, high = envelope(ranks.size, num_histograms)
    counts = histogram(ranks)
    return bool(np.all(counts >= low) and np.all(counts <= high))


def gates(rows: Sequence[Row]) -> list[str]:
    """Return the rows of the gates, as `gate_rows` has them."""
    found = []
    for cell, wanted in FEWEST.items():
        num = sum(cell in ("all", row["cell"]) for row in rows)
        mark = "met" if num >= wanted else "**missed**"
        found.append(f"| records, {cell} | ≥ {wanted} | {num} | – | {mark} |")
    honest = ("as declared", "exact instruments")
    for cell in (*honest, *MISSPECIFIED):
        for method in ("laplace", "quick", "emcee"):
            mine = chosen(rows, cell, method)
            for name in NETWORK if mine else ():
                what = f"95 % interval of {name}, {method}, {cell}"
                inside = (np.abs(rank(mine, method, name) - 0.5) <= 0.475).tolist()
                found.append(
                    covered(what, inside) if cell in honest else at_least(what, 0.85, inside)
                )
    drawn = chosen(rows, "prior draws", "quick")
    for group in GROUPS if drawn else ():
        low, high = envelope(len(drawn), len(group))
        for name in group:
            ranks = rank(drawn, "quick", name)
            counts = histogram(ranks)
            mark = "met" if is_inside(ranks, len(group)) else "**missed**"
            found.append(
                f"| rank histogram of {name}, quick, prior draws | bins of {low}…{high} | "
                f"{counts.min()}…{counts.max()} of {ranks.size} | – | {mark} |"
            )
    for cell in honest:
        shares = [row["quick"] for row in chosen(rows, cell, "quick")]
        found.append(in_band(f"30 s means of held-out tests inside the 95 % band, {cell}", shares,
                             "share_95"))  # fmt: skip
    return found
