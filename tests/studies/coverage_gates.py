"""What the rows of the coverage study say: coverage with its binomial limits, ranks, gates."""

from collections.abc import Iterable, Sequence
from functools import cache
from pathlib import Path

import numpy as np
from gate_rows import limits_95
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
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


def binomial_limits(share: float, num: int) -> tuple[float, float]:
    return limits_95(round(share * num), num)


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


def gates(rows: Sequence[Row]) -> list[Row]:
    found = []
    for cell, wanted in FEWEST.items():
        num = sum(cell in ("all", row["cell"]) for row in rows)
        found.append(_gate("records", cell, f"≥ {wanted}", str(num), num, num >= wanted))
    for cells, methods, wanted in (
        (("as declared", "exact instruments"), ("laplace", "quick", "emcee"), (0.93, 0.97)),
        (MISSPECIFIED, ("laplace", "quick"), (0.85, 1.0)),
    ):
        for cell in cells:
            for method in methods:
                mine = chosen(rows, cell, method)
                for name in NETWORK if mine else ():
                    share = coverage(rank(mine, method, name), 0.95)
                    what = f"95 % interval of {name}, {method}"
                    limits = binomial_limits(share, len(mine))
                    found.append(_of_share(what, cell, wanted, share, len(mine), limits))
    drawn = chosen(rows, "prior draws", "quick")
    for group in GROUPS if drawn else ():
        low, high = envelope(len(drawn), len(group))
        for name in group:
            ranks = rank(drawn, "quick", name)
            counts = histogram(ranks)
            found.append(_gate(
                f"rank histogram of {name}, quick", "prior draws", f"bins of {low}…{high}",
                f"{counts.min()}…{counts.max()}", ranks.size, is_inside(ranks, len(group)),
            ))  # fmt: skip
    for cell in ("as declared", "exact instruments"):
        if mine := chosen(rows, cell, "quick"):
            shares = [row["quick"]["share_95"] for row in mine]
            what = "30 s means of held-out tests inside the 95 % band"
            mean = float(np.mean(shares))
            found.append(_of_share(what, cell, (0.9, 0.98), mean, len(mine), _bootstrap(shares)))
    return found


def _gate(
    what: str, cell: str, wanted: str, measured: str, cases: int, holds: bool,
    limits: str | None = None, is_chance: bool = False,
) -> Row:  # fmt: skip
    return {"what": what, "cell": cell, "wanted": wanted, "measured": measured, "limits": limits,
            "cases": cases, "holds": holds, "is_chance": is_chance}  # fmt: skip


def _of_share(
    what: str, cell: str, wanted: tuple[float, float], share: float, num: int,
    limits: tuple[float, float],
) -> Row:  # fmt: skip
    low, high = wanted
    text = f"≥ {100 * low:.0f} %" if high >= 1.0 else f"{100 * low:.0f}…{100 * high:.0f} %"
    return _gate(
        what, cell, text, f"{100 * share:.1f} %", num, low <= share <= high,
        f"{100 * limits[0]:.1f}…{100 * limits[1]:.1f} %", limits[0] <= high and limits[1] >= low,
    )  # fmt: skip


def _bootstrap(shares: Iterable[float]) -> tuple[float, float]:
    """Return 95 % limits of a mean over records, whose block means are not independent."""
    values = np.asarray(list(shares))
    rng = np.random.default_rng(0)
    means = values[rng.integers(values.size, size=(2000, values.size))].mean(axis=1)
    return float(np.quantile(means, 0.025)), float(np.quantile(means, 0.975))


CELLS = (
    "as declared", "exact instruments", "slower noise", "stronger noise", "noise that doubles",
    "heavy tails", "truncated", "large errors, declared", "large errors, not declared",
    "errors taken as none", "point samples at 1 Hz", "unevenly soaked",
)  # fmt: skip
COLOURS = ("#1f4e79", "#c55a11", "#548235", "#7f6000")


def draw_coverage(rows: Sequence[Row], path: Path) -> None:
    figure = Figure(figsize=(9.0, 6.0), layout="constrained")
    axis = figure.subplots()
    shown = [cell for cell in CELLS if chosen(rows, cell, "quick")]
    axis.axvspan(93.0, 97.0, color="#dde8dd", zorder=0)
    axis.axvline(95.0, color="0.4", linewidth=0.8)
    for place, cell in enumerate(shown):
        mine = chosen(rows, cell, "quick")
        for offset, (name, colour) in enumerate(zip(NETWORK, COLOURS, strict=True)):
            share = coverage(rank(mine, "quick", name), 0.95)
            low, high = binomial_limits(share, len(mine))
            height = place + 0.17 * (offset - 1.5)
            label = name if place == 0 else None
            axis.plot([100 * low, 100 * high], [height] * 2, color=colour, linewidth=1.5)
            axis.plot([100 * share], [height], "o", color=colour, markersize=4, label=label)
    ticks = [f"{cell} ({len(chosen(rows, cell, 'quick'))})" for cell in shown]
    axis.set_yticks(range(len(shown)), ticks)
    axis.invert_yaxis()
    axis.set_xlabel("true value inside the 95 % interval [%], with 95 % binomial limits")
    axis.legend(loc="upper left")
    _save(figure, path)


def draw_ranks(rows: Sequence[Row], path: Path) -> None:
    drawn = chosen(rows, "prior draws", "quick")
    if not drawn:
        return
    figure = Figure(figsize=(10.0, 7.0), layout="constrained")
    names = (*NETWORK, *TIMES, *NOISE, "end")
    axes = figure.subplots(-(-len(names) // 4), 4, sharex=True, sharey=True).ravel()
    for spare in axes[len(names) :]:
        spare.set_axis_off()
    for axis, name in zip(axes, names, strict=False):
        ranks = rank(drawn, "quick", name)
        size = next(len(group) for group in GROUPS if name in group)
        low, high = envelope(ranks.size, size)
        axis.axhspan(low, high, color="#dde8dd")
        edges = np.linspace(0.0, 1.0, NUM_BINS + 1)
        axis.stairs(histogram(ranks), edges, color=COLOURS[0])
        word = "" if is_inside(ranks, size) else ", outside"
        axis.set_title(f"{'held-out end' if name == 'end' else name}{word}", fontsize=9)
    figure.supxlabel("share of the posterior below the truth")
    figure.supylabel(f"records of {len(drawn)}")
    _save(figure, path)


def _save(figure: Figure, path: Path) -> None:
    FigureCanvasAgg(figure)
    figure.savefig(path, dpi=110, metadata={"Software": None})
