"""The table of the study of noise over a fleet, worked out from its rows."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from discovery_gates import limits_95
from fleet_cases import NAMES
from fleet_noise_cases import NOISE
from fleet_noise_rows import NEXT_MIN, NUM_NEXT, TEST_MIN
from gate_rows import at_least, at_most

Row = dict[str, Any]

TIMES_BETTER = 2.0
"""By which sisters are to reduce the error of Req_sr from a test of ten minutes [1]."""


def table(rows: Sequence[Row], said: Row) -> str:
    """Return the tables in Markdown.

    Args:
        rows: The fleets.
        said: `seed`, `planned`, `command` and `versions` of the rows.
    """
    machines = [each for row in rows for each in row["machines_found"]]
    of_type = [each for row in rows for each in row["type"]]
    with_effect = sum(row["has_effect"] for row in rows)
    usual = [m["noise_inside"] for m in machines if "noise_inside" in m and not m["is_other"]]
    lines = [
        "# Noise, unmodelled heat and a named effect over fleets",
        "",
        f"`python tests/studies/fleet_noise.py` (`make study-fleet`), seeds from {said['seed']} "
        f"on; {len(rows)} of {said['planned']} fleets, {len(machines)} machines that count, of "
        f"tests of {TEST_MIN:.0f} min. Two-node machines by NumPy after Runge and Kutta; slow and "
        "white noise of the winding and heat that nobody measures differ from machine to machine, "
        "the heat of a usual size in half of the types and three times that in the others; "
        f"{with_effect} types warm the winding with a share of their other losses, and their motor "
        "file names the effect. The heat is smoother than the process that heatrun takes it for. "
        "In 5 % of the machines the slow noise or the heat is 5 to 9 times as large. Through "
        "`heatrun.calibrate_fleet` and `heatrun population`, back from the files. Then "
        f"{NUM_NEXT} further machines of each type with a test of {NEXT_MIN:.0f} min under one "
        "load, with and without `[population]`. Limits: 95 % after Clopper and Pearson.",
        "",
        "| 95 % intervals | gate | hold the truth | limits | |",
        "|---|---|---|---|---|",
        *(_covered(what, _inside(of_type, of, kind)) for what, of, kind in TYPES),
        *_by_heat(rows),
        _covered("noise and heat of each machine", _flat(usual)),
        _covered("heat of the next machine", _flat(row["heat_of_the_next"] for row in rows)),
        _covered("parameters of each machine", _flat(m["inside_given"] for m in machines)),
        _covered("effect of each machine",
                 [m["effect_inside"] for m in machines if "effect_inside" in m]),
        "",
        "| what | gate | found | limits | |",
        "|---|---|---|---|---|",
        at_least("machines with another noise found", 0.90, _called(machines, is_other=True)),
        at_most("called so though they are none", 0.02, _called(machines, is_other=False)),
        at_most("called another motor, which none is", 0.02, [m["is_outlier"] for m in machines]),
        "",
        f"| a test of {NEXT_MIN:.0f} min: RMSE of the logarithm | " + " | ".join(NAMES)
        + " | 95 % intervals that hold the truth |",
        "|---|" + "---|" * (len(NAMES) + 1),
        *(_next(rows, how, words) for how, words in HOW),
        "",
        _better(rows),
        "",
        f"Converged: {sum(row['is_converged'] for row in rows)} of {len(rows)} populations. Left "
        f"out: {sum(len(row['left_out']) for row in rows)} machines. "
        f"{sum(row['processor_s'] for row in rows) / 60:.0f} min in all. What the calibrations "
        "call noise and heat holds whatever else the network leaves.",
        "",
        f"`{said['command']}`, {', '.join(f'{k} {v}' for k, v in said['versions'].items())}.",
    ]  # fmt: skip
    return "\n".join(lines) + "\n"


TYPES = (
    ("medians of the network's parameters", "network", "median"),
    ("medians of noise and heat", "noise", "median"),
    ("spreads of noise and heat", "noise", "spread"),
    ("medians of the effect", "effect", "median"),
    ("spreads of the effect", "effect", "spread"),
)


def _by_heat(rows: Sequence[Row]) -> list[str]:
    """Return how often the medians of the noise hold their truth, by parameter and by heat."""
    lines = []
    for heat in sorted({row["heat"] for row in rows}):
        of_type = [each for row in rows if row["heat"] == heat for each in row["type"]]
        for name in NOISE:
            own = [each for each in of_type if (each["name"], each["kind"]) == (name, "median")]
            off = np.median([np.log(each["value"] / each["truth"]) for each in own])
            inside = _inside(own, "noise", "median")
            lines.append(
                f"| – of {name}, types with {100 * heat:g} % of heat | | {sum(inside)} of "
                f"{len(inside)} | | off by {100 * np.expm1(off):+.0f} % (median) |"
            )
    return lines


HOW = (("alone", "its own test alone"), ("sisters", "`[population]`"))


def _inside(entries: Sequence[Row], of: str, kind: str) -> list[bool]:
    return [each["low"] <= each["truth"] <= each["high"] for each in entries
            if (each["of"], each["kind"]) == (of, kind)]  # fmt: skip


def _flat(lists: Iterable[Sequence[bool]]) -> list[bool]:
    return [each for one in lists for each in one]


def _covered(what: str, inside: Sequence[bool]) -> str:
    if not inside:
        return f"| {what} | 93…97 % | – | – | – |"
    count, num = sum(inside), len(inside)
    low, high = limits_95(count, num)
    mark = "met" if 0.93 <= count / num <= 0.97 else "**outside**"
    if mark != "met" and low <= 0.97 and high >= 0.93:
        mark = "outside, within what so few can show"
    return (
        f"| {what} | 93…97 % | {100 * count / num:.1f} % ({count} of {num}) | "
        f"{100 * low:.0f}…{100 * high:.0f} % | {mark} |"
    )


def _called(machines: Sequence[Row], *, is_other: bool) -> list[bool]:
    return [m["probability"] > 0.5 for m in machines
            if m["probability"] is not None and m["is_other"] == is_other]  # fmt: skip


def _next(rows: Sequence[Row], how: str, words: str) -> str:
    found = [each for row in rows for each in row["next"][how]]
    fitted = [each for each in found if "error" in each]
    rms = _rms([each["error"] for each in fitted])
    inside = _flat(each["is_inside"] for each in fitted)
    low, high = limits_95(sum(inside), len(inside))
    cells = " | ".join(f"{100 * each:.1f} %" for each in rms)
    return (
        f"| {words} ({len(fitted)} of {len(found)} fitted) | {cells} | "
        f"{100 * np.mean(inside):.1f} % ({100 * low:.0f}…{100 * high:.0f} %) |"
    )


def _better(rows: Sequence[Row]) -> str:
    place = NAMES.index("Req_sr")
    pairs = [
        (alone["error"][place], sister["error"][place])
        for row in rows
        for alone, sister in zip(row["next"]["alone"], row["next"]["sisters"], strict=True)
        if "error" in alone and "error" in sister
    ]
    alone, sister = np.array(pairs).T
    ratio = float(_rms(alone) / _rms(sister))
    picks = np.random.default_rng(0).integers(len(pairs), size=(2000, len(pairs)))
    drawn = np.sqrt(np.mean(alone[picks] ** 2, axis=1) / np.mean(sister[picks] ** 2, axis=1))
    low, high = np.quantile(drawn, [0.025, 0.975])
    mark = "met" if low >= TIMES_BETTER else "met, too few cases to show it"
    return (
        f"RMSE of Req_sr, alone over with sisters: {ratio:.1f} ({low:.1f}…{high:.1f}); at least "
        f"{TIMES_BETTER:.0f}: {mark if ratio >= TIMES_BETTER else '**missed**'}."
    )


def _rms(errors: Any) -> Any:
    return np.sqrt(np.mean(np.square(errors), axis=0))
