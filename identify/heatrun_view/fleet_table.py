"""The machines of a fleet as the page shows them: a row each, and all that is known of one."""

from __future__ import annotations

import json
import math
import shlex
from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

import numpy as np

from heatrun.bench import Finding
from heatrun.io.quantities import printed_unit

from .fleets import Row
from .words import findings_html, message, table

TWO_SIDED_95 = 1.959964

ROOM = 5.0
"""Half of the width of a strip, in robust standard deviations over the machines of the type."""

STRIP = 100
"""Units of a strip from its left end to its right."""

UNKNOWN = -math.inf


def columns(rows: Sequence[Row], sisters: Mapping[str, Row]) -> dict[str, list[Any]]:
    """Return what stands in the table, by column.

    Numbers that are not known are minus infinity: sorted from the largest on, they come last.

    `value_0`, `value_1`, … are the most probable values in the order of `parameters`, and `text_0`,
    … the same with 95 % interval. `strip` holds for each parameter where interval and value lie
    among the machines of the type, from 0 to 100.

    Args:
        rows: Of the fleet.
        sisters: What populations say of the machines.
    """
    found: dict[str, list[Any]] = {
        "machine": [row["machine"] for row in rows],
        "type": [row["type"] for row in rows],
        "covariates": [", ".join(v for _, v in row["covariates"] or []) for row in rows],
        "verdict": [verdict(row, sisters.get(row["machine"])) for row in rows],
        "strip": _strips(rows),
        "outlier": [_number(sisters.get(row["machine"], {}).get("outlier_probability"))
                    for row in rows],
        "rmse": [_number(row["rmse_K"]) for row in rows],
        "warnings": [sum(f.severity != "note" for f in findings(row)) for row in rows],
    }  # fmt: skip
    said = [intervals(row) for row in rows]
    for place, name in enumerate(parameters(rows)):
        own = [each.get(name) for each in said]
        found[f"value_{place}"] = [UNKNOWN if each is None else each[1] for each in own]
        found[f"text_{place}"] = ["" if each is None else _ranged(*each) for each in own]
    return found


def parameters(rows: Sequence[Row]) -> dict[str, str]:
    """Return the names of the thermal parameters of all machines, with their units."""
    return {
        name: unit
        for row in rows
        for name, unit in zip(row["parameters"] or [], row["parameter_units"] or [], strict=True)
    }


def intervals(row: Row) -> dict[str, tuple[float, float, float]]:
    """Return lower limit of the 95 % interval, most probable value and upper limit, by name.

    Args:
        row: Of a machine.
    """
    if not row["parameters"]:
        return {}
    num = len(row["parameters"])
    sd = np.sqrt(np.diag(np.reshape(row["log_covariance"], (num, num))))
    found = {}
    for name, transform, value, mean, error in zip(
        row["parameters"], row["transforms"], row["parameter_values"], row["log_mean"], sd,
        strict=True,
    ):  # fmt: skip
        ends = mean + TWO_SIDED_95 * error * np.array([-1.0, 1.0])
        low, high = np.exp(ends) if transform == "log" else ends
        found[name] = (float(low), float(value), float(high))
    return found


def findings(row: Row) -> list[Finding]:
    """Return the findings of a machine."""
    return [Finding(**each) for each in json.loads(row["findings"] or "[]")]


def files(row: Row, role: str) -> list[str]:
    """Return the files of a machine, as its fleet file names them.

    Args:
        row: Of the machine.
        role: `"motor"`, `"calibration"` or `"holdout"`.
    """
    return [each["path"] for each in row["inputs"] or [] if each["role"] == role]


def verdict(row: Row, sister: Row | None) -> str:
    """Return in a few words what became of a machine.

    Args:
        row: Of the machine.
        sister: What its population says of it; None where there is none.
    """
    if row["status"] != "fitted":
        return str(row["status"])
    if not row["is_converged"]:
        return "not converged"
    if sister is not None and sister["is_outlier"]:
        return "does not fit its type"
    return "fitted"


def headline(rows: Sequence[Row], sisters: Mapping[str, Row], is_whole: bool) -> str:
    """Return in a sentence or two what the fleet is.

    Args:
        rows: Of the fleet.
        sisters: What populations say of the machines.
        is_whole: Whether all machines are there.
    """
    count: dict[str, int] = {}
    for row in rows:
        word = verdict(row, sisters.get(row["machine"]))
        count[word] = count.get(word, 0) + 1
    said = ", ".join(f"{num} {word}" for word, num in sorted(count.items()))
    words = f"{len(rows)} machines: {said}."
    if not is_whole:
        words += " The fleet is being worked out: these are the machines that are there so far."
    if not sisters:
        words += (
            " No population of these machines is in the folder: `heatrun population` says which "
            "do not fit their type."
        )
    return words


def details(row: Row, sister: Row | None) -> str:
    """Return all that is known of a machine as HTML.

    Args:
        row: Of the machine.
        sister: What its population says of it; None where there is none.
    """
    kind = f" · type {escape(row['type'])}" if row["type"] else ""
    said = "".join(f" · {escape(k)} {escape(v)}" for k, v in row["covariates"] or [])
    parts = [f"<h3>{escape(row['machine'])}{kind}{said}</h3>"]
    word = verdict(row, sister)
    parts.append(f"<p>{escape(word)}{'' if word == 'fitted' else _why(row, sister)}</p>")
    if row["parameters"]:
        head, lines = _parameter_rows(row, sister)
        parts.append(table(head, lines))
        heldout = [
            (name, f"{rmse:.2f} K", f"{100 * inside:.0f} %")
            for name, rmse, inside in zip(
                *(
                    row[key] or []
                    for key in ("holdout_tests", "holdout_rmse_K", "holdout_coverage_95")
                ),
                strict=True,
            )
        ]
        if row["rmse_K"] is not None:
            tests = "1 test" if row["num_tests"] == 1 else f"{row['num_tests']} tests"
            minutes = row["duration_s"] / 60.0
            parts.append(f"<p>RMSE {row['rmse_K']:.2f} K over {tests}, {minutes:.0f} min.</p>")
        if heldout:
            parts.append(table(["held out", "RMSE", "inside the 95 % band"], heldout))
    own = findings(row)
    parts.append(findings_html(own) if own else message("note", "No findings."))
    motors, tests, held = (files(row, role) for role in ("motor", "calibration", "holdout"))
    if motors and tests:
        words = ["heatrun", "calibrate", motors[0], *tests, *(["--holdout", *held] if held else [])]
        parts.append(f"<p>By itself, with posterior and sheet: <code>"
                     f"{escape(' '.join(map(shlex.quote, words)))}</code></p>")  # fmt: skip
    return "".join(parts)


def _parameter_rows(row: Row, sister: Row | None) -> tuple[list[str], list[list[str]]]:
    head = ["parameter", "unit", "by its own tests (95 %)"]
    units = parameters([row])
    lines = {
        name: [name, printed_unit(units[name]), _ranged(*each)]
        for name, each in intervals(row).items()
    }
    if sister is not None:
        head += ["given its sisters (95 %)", "distance from its type"]
        for name, value, low, high, off in zip(
            sister["parameters"], sister["given_values"], sister["given_low_95"],
            sister["given_high_95"], sister["distance_sd"], strict=True,
        ):  # fmt: skip
            if name in lines:
                lines[name] += [_ranged(low, value, high), f"{off:+.1f} sd"]
    return head, [line for line in lines.values() if len(line) == len(head)]


def _why(row: Row, sister: Row | None) -> str:
    if sister is not None and sister["is_outlier"]:
        named = ", ".join(sister["different"]) or "no single parameter stands out"
        return f" (probability {sister['outlier_probability']:.2f}; different: {escape(named)})"
    return f": {escape(row['result'] or '')}" if row["result"] else ""


def _ranged(low: float, value: float, high: float) -> str:
    """Return a value with its interval, to a digit that the interval leaves sense."""
    if not all(map(math.isfinite, (low, value, high))):
        return ""
    width = max(high - low, abs(value) * 1e-6)
    last = math.floor(math.log10(width)) - 1  # two digits of the width
    if last >= 0:
        value, low, high = (round(each, -last) for each in (value, low, high))
    places = min(max(0, -last), 12)
    return f"{value:.{places}f} ({low:.{places}f} … {high:.{places}f})"


def _strips(rows: Sequence[Row]) -> list[list[int]]:
    """Return for each machine low, middle and high of each parameter among those of its type."""
    said = [
        [] if row["status"] != "fitted" else
        [(name, *each) for name, each in intervals(row).items()]
        for row in rows
    ]  # fmt: skip
    middles: dict[tuple[str, str], list[float]] = {}
    for row, own in zip(rows, said, strict=True):
        for name, _, value, _ in own:
            middles.setdefault((row["type"], name), []).append(value)
    scales = {}
    for key, values in middles.items():
        centre = float(np.median(values))
        spread = 1.4826 * float(np.median(np.abs(np.array(values) - centre)))
        scales[key] = centre, spread or 0.01 * abs(centre) or 1.0
    found = []
    for row, own in zip(rows, said, strict=True):
        places: list[int] = []
        for name, *ends in own:
            centre, spread = scales[row["type"], name]
            shares = (np.array(ends) - centre) / (2.0 * ROOM * spread) + 0.5
            places += [round(STRIP * float(np.clip(share, 0.0, 1.0))) for share in shares]
        found.append(places)
    return found


def _number(value: float | None) -> float:
    return UNKNOWN if value is None else float(value)
