"""The table of the coverage study."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from coverage_gates import (
    GROUPS,
    LEVELS,
    NETWORK,
    TIMES,
    Row,
    binomial_limits,
    chosen,
    coverage,
    histogram,
    is_inside,
    rank,
)

from heatrun.posterior.identifiability import BETWEEN_K

METHODS = ("laplace", "quick", "emcee")

READING = """\
Motors at random over a decade in size, cold tests of 30, 60 and 90 min (one to three slow time
constants, staircase, constant load, duty and drive cycle in turn), integrated by the
simulated bench of `data/synthetic`, which shares no code with the packages. The winding is read at
1 Hz, the rest at 4 Hz. Noise of the winding
sensor: Ornstein-Uhlenbeck of 0.1…0.5 K and 5…120 s, white of 0.05…0.2 K per sample, resolution 0.1
or 1 K; losses with 1 % of noise per sample. Held-out tests are twice as long, of another kind,
judged on 30 s means. Record i of every cell has the same motor, tests and standard scores of errors
and noise.

- *as declared*: type B errors of the bench drawn from the priors that heatrun states (losses 1 %,
  sensor 0.5 % and 0.5 K, sink 0.5 K, resistance 1 %).
- *exact instruments*: no such errors, and the motor file says so. The cells of misspecified noise
  are like this one but for the noise: *slower* (×4 in time), *stronger* (×2 in level), one that
  *doubles* half way, and *heavy tails* (Student t, 3 degrees of freedom).
- *truncated*: as declared, but the logger cuts off instead of rounding.
- *large errors*: losses 2 %, sensor offset 1 K, resistance 3 %; once declared in the motor file,
  once not (heatrun's own priors stand). *errors taken as none*: as declared, but the file says
  exact.
- *point samples at 1 Hz*: exact instruments, but current and power are sampled once a second
  without averaging, while torque ramps in half a second.
- *unevenly soaked*: exact instruments, but the stator starts 1 K (standard deviation) from the
  winding, as the prior of the fit grants; in all other cells both start at ambient temperature.
- *prior draws*: network, noise and heat that the network misses drawn from the priors of the fit
  (network ±30 % about the reference motor, stated in the file; heat into both nodes, in all other
  cells there is none), 60 min tests: simulation-based calibration.

Methods: *laplace* is the covariance at the fit, *quick* the weighted draws (all of them, whether
their guard held or not), *emcee* the ensembles. Fits start from 4 points. Limits are 95 % binomial
(Clopper-Pearson).
"""

MISSES = """\
*Within chance*: the binomial limits reach into what was wanted. What is known of the others:

- *truncated*, end of the held-out test: a logger that cuts off reads half a step low, at the end of
  the test as at every moment before; the network follows the readings.
"""


def table(rows: Sequence[Row], found: Sequence[dict[str, Any]], content: dict[str, Any]) -> str:
    """Return the table as Markdown."""
    lines = [
        "# Are the intervals honest?",
        "",
        f"`{content['command']}`: {len(rows)} records of {content['planned']} planned, seed "
        f"{content['seed']}, run once with frozen code; "
        f"tuning used seed {content['tuning_seed']} alone. "
        f"{content['cpu_s'] / 60:.0f} min of one processor, compilation included.",
        "",
        READING,
    ]
    if found:
        lines += _gates(found)
    cells = list(dict.fromkeys(row["cell"] for row in rows))
    lines += ["## Coverage of 50, 90 and 95 % intervals [%]", ""]
    names = (*NETWORK, *TIMES, "end")
    lines += [f"| cell | method | records | {' | '.join(names)} |", "|---" * (3 + len(names)) + "|"]
    for cell in cells:
        for method in METHODS:
            mine = chosen(rows, cell, method)
            if mine:
                lines.append(_coverage_line(cell, method, mine, names))
    lines += ["", "`end`: the reading without noise at the end of the held-out test.", ""]
    lines += _by_duration(rows)
    lines += _prediction(rows, cells)
    lines += _between(rows)
    lines += _widths(rows, cells)
    lines += _ranks(rows)
    lines += _guards(rows, cells)
    return "\n".join(lines) + "\n"


def _gates(found: Sequence[dict[str, Any]]) -> list[str]:
    lines = [
        "## Gates",
        "",
        "| what | cell | wanted | measured | 95 % limits | records | |",
        "|---|---|---|---|---|---|---|",
    ]
    for gate in found:
        missed = "**MISSED**, within chance" if gate["is_chance"] else "**MISSED**"
        mark = "met" if gate["holds"] else missed
        lines.append(
            f"| {gate['what']} | {gate['cell']} | {gate['wanted']} | {gate['measured']} | "
            f"{gate['limits'] or '–'} | {gate['cases']} | {mark} |"
        )
    return [*lines, "", MISSES, ""]


def _coverage_line(cell: str, method: str, rows: Sequence[Row], names: Sequence[str]) -> str:
    parts = []
    for name in names:
        if name not in rows[0][method]["ranks"]:
            parts.append("–")
            continue
        ranks = rank(rows, method, name)
        parts.append(" / ".join(f"{100 * coverage(ranks, level):.0f}" for level in LEVELS))
    return f"| {cell} | {method} | {len(rows)} | {' | '.join(parts)} |"


def _by_duration(rows: Sequence[Row]) -> list[str]:
    """Return coverage of 95 % by length of the test."""
    lines = ["## Coverage of 95 % intervals by length of the test, quick [%]", ""]
    lines += [f"| cell | test | records | {' | '.join(NETWORK)} |", "|---" * 7 + "|"]
    for cell in ("as declared", "exact instruments"):
        for key, unit, scale in (("duration_s", "min", 60.0), ("kind", "", 1.0)):
            mine = chosen(rows, cell, "quick")
            for value in sorted({row[key] for row in mine}):
                some = [row for row in mine if row[key] == value]
                label = value if key == "kind" else f"{value / scale:.0f} {unit}"
                parts = []
                for name in NETWORK:
                    share = coverage(rank(some, "quick", name), 0.95)
                    low, high = binomial_limits(share, len(some))
                    parts.append(f"{100 * share:.0f} ({100 * low:.0f}…{100 * high:.0f})")
                lines.append(f"| {cell} | {label} | {len(some)} | {' | '.join(parts)} |")
    return [*lines, ""]


def _prediction(rows: Sequence[Row], cells: Sequence[str]) -> list[str]:
    lines = ["## Held-out tests of twice the length, quick", ""]
    head = ("cell", "30 s means in the 50 % band [%]", "in the 95 % band [%]",
            "in the 95 % band, worst tenth of records [%]", "median sd at the end [K]")  # fmt: skip
    lines += [f"| {' | '.join(head)} |", "|---" * len(head) + "|"]
    for cell in cells:
        mine = [row["quick"] for row in chosen(rows, cell, "quick")]
        share = np.array([row["share_95"] for row in mine])
        half = np.mean([row["share_50"] for row in mine])
        end = np.median([row["end_sd_K"] for row in mine])
        lines.append(f"| {cell} | {100 * half:.0f} | {100 * share.mean():.1f} | "
                     f"{100 * np.quantile(share, 0.1):.0f} | {end:.2f} |")  # fmt: skip
    return [*lines, ""]


def _between(rows: Sequence[Row]) -> list[str]:
    """Return coverage where the load was logged slowly, by what heatrun says of it."""
    slow = [row for row in rows if max(row.get("between_K", [0.0])) > 0.0]
    if not slow:
        return []
    lines = [
        "## Loads sampled in points, quick",
        "",
        f"*Lost*: heatrun's estimate of what the load does between its samples, in one of the two "
        f"tests, is above its limit of {BETWEEN_K} K (finding `between_samples`).",
        "",
        f"| calibrated on | lost | records | estimate [K] | {' | '.join(NETWORK)} | end "
        "| in the 95 % band |",
        "|---" * (len(NETWORK) + 6) + "|",
    ]
    for is_lost in (False, True):
        mine = [row for row in slow if (max(row["between_K"]) > BETWEEN_K) == is_lost]
        if mine:
            kinds = ", ".join(sorted({row["kind"] for row in mine})).replace("_", " ")
            largest = [max(row["between_K"]) for row in mine]
            parts = [
                f"{100 * coverage(rank(mine, 'quick', name), 0.95):.0f}"
                for name in (*NETWORK, "end")
            ]
            share = np.mean([row["quick"]["share_95"] for row in mine])
            lines.append(
                f"| {kinds} | {'yes' if is_lost else 'no'} | {len(mine)} | "
                f"{np.median(largest):.2f}, at most {max(largest):.2f} | {' | '.join(parts)} | "
                f"{100 * share:.1f} |"
            )
    return [*lines, ""]


def _widths(rows: Sequence[Row], cells: Sequence[str]) -> list[str]:
    lines = [
        "## Width over the attainable one",
        "",
        "Median over the records of the posterior's standard deviation of the logarithm over the "
        "Cramér-Rao bound with the true noise and the same priors; in brackets the bound [%].",
        "",
        f"| cell | method | {' | '.join(NETWORK)} |",
        "|---" * 6 + "|",
    ]
    for cell in cells:
        for method in METHODS:
            mine = chosen(rows, cell, method)
            if not mine:
                continue
            parts = []
            for name in NETWORK:
                best = np.array([row["bound"][name] for row in mine])
                ratio = np.array([row[method]["sd"][name] for row in mine]) / best
                parts.append(f"{np.median(ratio):.2f} ({100 * np.median(best):.1f})")
            lines.append(f"| {cell} | {method} | {' | '.join(parts)} |")
    return [*lines, ""]


def _ranks(rows: Sequence[Row]) -> list[str]:
    drawn = chosen(rows, "prior draws", "quick")
    if not drawn:
        return []
    lines = [f"## Rank histograms, {len(drawn)} draws from the prior, quick", ""]
    lines += [
        "The envelope holds all bins of all quantities of one group in 95 % of studies.",
        "",
        "| quantity | counts | inside |",
        "|---|---|---|",
    ]
    for group in GROUPS:
        for name in group:
            ranks = rank(drawn, "quick", name)
            counts = " ".join(str(count) for count in histogram(ranks))
            mark = "yes" if is_inside(ranks, len(group)) else "**no**"
            lines.append(f"| {name} | {counts} | {mark} |")
    return [*lines, ""]


def _guards(rows: Sequence[Row], cells: Sequence[str]) -> list[str]:
    lines = ["## What the fit and the sampler said", ""]
    head = ("cell", "weighted draws sound [%]", "flagged as misfit [%]",
            "several optima [%]", "unmodelled heat above 0.5 % of the loss [%]")  # fmt: skip
    lines += [f"| {' | '.join(head)} |", "|---" * len(head) + "|"]
    for cell in cells:
        mine = chosen(rows, cell, "quick")
        shares = (
            np.mean([row["quick"]["is_sound"] for row in mine]),
            np.mean(["misfit" in row["findings"] for row in mine]),
            np.mean(["several_optima" in row["findings"] for row in mine]),
            np.mean([row["unmodelled_heat"] > 0.005 for row in mine]),
        )
        lines.append(f"| {cell} | " + " | ".join(f"{100 * share:.0f}" for share in shares) + " |")
    return lines
