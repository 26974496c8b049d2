"""The table of the study of populations, worked out from its rows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from discovery_gates import limits_95
from fleet_cases import NAMES
from gate_rows import at_least, at_most

Row = dict[str, Any]

WITHIN = 0.05
"""How near the two stages are to come to one [1]."""

TIMES_BETTER = 2.0
"""By which pooling is to reduce the error of a short test's Req_sr [1]."""


def table(rows: Sequence[Row], one_stage: Row | None, said: Row) -> str:
    """Return the tables in Markdown.

    Args:
        rows: The fleets.
        one_stage: Of `fleet_one_stage.py`; None where it was not run.
        said: `seed`, `planned`, `command` and `versions` of the rows.
    """
    machines = [each for row in rows for each in row["machines_found"]]
    num = sum(row["machines"] for row in rows)
    lines = [
        "# Populations of simulated fleets",
        "",
        f"`make study-fleet`, seeds from {said['seed']} on; {len(rows)} of {said['planned']} "
        f"fleets, {num} machines in all. Two-node machines integrated by NumPy after Runge and "
        "Kutta, half of them with a test of 30 minutes under one load, half with one of two hours "
        "under a staircase; two suppliers; 5 % of the machines are something else in one "
        "parameter, by 35…55 % of its logarithm; type, correlations, supplier and instruments "
        "drawn, the errors of the instruments as heatrun's priors have them and each machine's its "
        "own; noise with a slow part of 0.15 K over 40 s and a white one of 0.1 K. Through "
        "`heatrun.calibrate_fleet` and `heatrun population --covariate supplier`, "
        "and back from the files. Limits: 95 % after Clopper and Pearson.",
        "",
        "| what | gate | found | limits | |",
        "|---|---|---|---|---|",
        *_coverage(rows),
        _rmse(machines),
        at_least("outliers found", 0.90, _flags(machines, is_outlier=True)),
        at_most("machines called outliers that are none", 0.02, _flags(machines, is_outlier=False)),
        "",
        "| among them | | found | limits | |",
        "|---|---|---|---|---|",
        *_outliers_by_test(machines),
        _named(machines),
        "",
        "| 95 % intervals of machines that fit | alone | given all |",
        "|---|---|---|",
        *_machines_covered(machines),
        "",
        "| RMSE of the logarithm [%] | " + " | ".join(NAMES) + " |",
        "|---|" + "---|" * len(NAMES),
        *_errors(machines),
        "",
        f"Left out: {sum(len(row['left_out']) for row in rows)} of {num} machines. Converged: "
        f"{sum(row['is_converged'] for row in rows)} of {len(rows)} populations.",
        "",
        f"`{said['command']}`, {', '.join(f'{k} {v}' for k, v in said['versions'].items())}.",
    ]
    return "\n".join([*lines, *_one_stage(one_stage)]) + "\n"


def _coverage(rows: Sequence[Row]) -> list[str]:
    every = [each for row in rows for each in row["population"]]
    kinds = [("all parameters of the population", every)]
    kinds += [(kind, [each for each in every if each["kind"] == kind])
              for kind in ("median", "spread", "supplier")]  # fmt: skip
    lines = []
    for what, entries in kinds:
        inside = [each["low"] <= each["truth"] <= each["high"] for each in entries]
        count, num = sum(inside), len(inside)
        if not num:
            continue
        low, high = limits_95(count, num)
        share = 100.0 * count / num
        mark = "met" if 93.0 <= share <= 97.0 else "outside"
        if mark == "outside" and low <= 0.97 and high >= 0.93:
            mark = "outside, within what so few can show"
        lines.append(
            f"| 95 % intervals, {what} | 93…97 % | {share:.1f} % ({count} of {num}) | "
            f"{100 * low:.0f}…{100 * high:.0f} % | {mark} |"
        )
    return lines


def _rmse(machines: Sequence[Row]) -> str:
    place = NAMES.index("Req_sr")
    short = [each for each in machines if each["is_short"] and not each["is_outlier"]]
    alone, given = (
        np.array([each[key][place] for each in short]) for key in ("error_alone", "error_given")
    )
    what = "RMSE of Req_sr from 30 min, alone over pooled"
    if not short:
        return f"| {what} | ≥ {TIMES_BETTER:.0f} | – | – | – |"
    rng = np.random.default_rng(0)
    picks = rng.integers(len(short), size=(2000, len(short)))
    ratio = float(_rms(alone) / _rms(given))
    drawn = np.sqrt(np.mean(alone[picks] ** 2, axis=1) / np.mean(given[picks] ** 2, axis=1))
    low, high = np.quantile(drawn, [0.025, 0.975])
    mark = "met" if low >= TIMES_BETTER else "met, too few cases to show it"
    mark = mark if ratio >= TIMES_BETTER else "**missed**"
    return (
        f"| {what} | ≥ {TIMES_BETTER:.0f} | {ratio:.2f} ({100 * _rms(alone):.1f} % to "
        f"{100 * _rms(given):.1f} %, {len(short)} machines) | {low:.2f}…{high:.2f} | {mark} |"
    )


def _flags(machines: Sequence[Row], *, is_outlier: bool) -> list[bool]:
    return [
        each["outlier_probability"] > 0.5 for each in machines if each["is_outlier"] == is_outlier
    ]


def _outliers_by_test(machines: Sequence[Row]) -> list[str]:
    lines = []
    for is_short, words in ((True, "30 min"), (False, "2 h")):
        own = [each for each in machines if each["is_short"] == is_short]
        lines.append(at_least(f"outliers found, {words}", 0.90, _flags(own, is_outlier=True)))
        lines.append(at_most(f"called outliers, {words}", 0.02, _flags(own, is_outlier=False)))
    return lines


def _named(machines: Sequence[Row]) -> str:
    found = [each for each in machines if each["is_outlier"] and each["outlier_probability"] > 0.5]
    named = [each["odd"] in each["different"] for each in found]
    return at_least("of the found ones, the parameter named that differs", 0.90, named)


def _machines_covered(machines: Sequence[Row]) -> list[str]:
    fits = [each for each in machines if not each["is_outlier"]]
    lines = []
    for is_short, words in ((True, "30 min"), (False, "2 h")):
        own = [each for each in fits if each["is_short"] == is_short]
        shares = []
        for key in ("is_inside_alone", "is_inside"):
            inside = np.array([each[key] for each in own], dtype=bool).reshape(len(own), -1)
            shares.append(f"{100 * inside.mean():.1f} % ({int(inside.sum())} of {inside.size})")
        lines.append(f"| {words} | {shares[0]} | {shares[1]} |")
    return lines


def _errors(machines: Sequence[Row]) -> list[str]:
    lines = []
    for is_short, words in ((True, "30 min"), (False, "2 h")):
        own = [e for e in machines if e["is_short"] == is_short and not e["is_outlier"]]
        for key, how in (("error_alone", "alone"), ("error_given", "given all")):
            errors = np.array([each[key] for each in own]).reshape(-1, len(NAMES))
            cells = " | ".join(f"{100 * _rms(column):.2f}" for column in errors.T)
            lines.append(f"| {words}, {how} | {cells} |")
    return lines


def _rms(errors: np.ndarray) -> float:
    return float(np.sqrt(np.mean(errors**2)))


def _one_stage(found: Row | None) -> list[str]:
    if found is None:
        return ["", "One stage was not run."]
    entries = [row for row in found["compared"] if row["kind"] != "supplier"]
    apart = {
        f"{row['kind']} of {row['parameter']}": row["two"][1] / row["one"][1] - 1.0
        for row in entries
    }
    far = [f"{name} ({100 * by:+.0f} %)" for name, by in apart.items() if abs(by) > WITHIN]
    said = f"Two stages within {100 * WITHIN:.0f} % of one stage: {len(apart) - len(far)} of "
    said += f"{len(apart)} medians and spreads{'; not ' + ', '.join(far) if far else ''}."
    return ["", "## One stage", "", *found["lines"], "", said]
