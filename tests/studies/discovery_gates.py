"""The gates of the discovery study, worked out from its rows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np


def is_right(row: dict[str, Any], effect: str) -> str:
    """Return `"exact"`, `"in set"` or `"missed"` for a hidden effect."""
    for named in row["named"]:
        if named["id"] == effect:
            return "exact"
    for named in row["named"]:
        if effect in named["equivalents"]:
            return "in set"
    return "missed"


def claims(row: dict[str, Any]) -> bool:
    """Whether a name is claimed."""
    return row["verdict"] in ("named", "ambiguous")


def gates(rows: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return each gate with what was measured and whether it holds."""
    clean = [r for r in rows if r["group"] == "clean"]
    shown = [
        r for r in rows
        if r["group"] == "effect" and r["is_visible"] and r["misfit_K"] > 0.5 * r["noise_K"]
    ]  # fmt: skip
    unknown = [r for r in rows if r["group"] == "unknown" and r["is_visible"]]
    pairs = [r for r in rows if r["group"] == "pair"]
    right = [is_right(r, r["hidden"][0]) if claims(r) else "missed" for r in shown]
    sizes = [1 + len(named["equivalents"]) for r in shown if claims(r) for named in r["named"]]
    both = [
        r["verdict"] in ("named", "ambiguous")
        and all(is_right(r, effect) != "missed" for effect in r["hidden"])
        for r in pairs
    ]
    closed = [
        _closed(r["held_out"]) for r in shown
        if r["held_out"] and "true_K" in r["held_out"] and _is_open(r["held_out"])
    ]  # fmt: skip
    seconds = [r["seconds"] for r in rows]
    return [
        _gate("any effect claimed on clean records", "≤ 5 %", _share(claims(r) for r in clean),
              lambda v: v <= 0.05, len(clean)),
        _gate("visible effects: named rightly, or in the stated set", "≥ 95 %",
              _share(r != "missed" for r in right), lambda v: v >= 0.95, len(right)),
        _gate("visible effects: exact", "≥ 85 %", _share(r == "exact" for r in right),
              lambda v: v >= 0.85, len(right)),
        _gate("mean size of the stated set", "≤ 2", float(np.mean(sizes)) if sizes else None,
              lambda v: v <= 2.0, len(sizes)),
        _gate("unknown cause: flagged unexplained", "≥ 90 %",
              _share(r["verdict"] == "unexplained" for r in unknown), lambda v: v >= 0.9,
              len(unknown)),
        _gate("unknown cause: wrongly named without a flag", "≤ 10 %",
              _share(claims(r) for r in unknown), lambda v: v <= 0.1, len(unknown)),
        _gate("two effects at once: both named", "≥ 75 %", _share(both), lambda v: v >= 0.75,
              len(both)),
        _gate("held-out gap closed over that of the true structure, median", "≥ 0.95",
              float(np.median(closed)) if closed else None, lambda v: v >= 0.95, len(closed)),
        _gate("share of cases in which it is at least 0.8", "≥ 95 %",
              _share(v >= 0.8 for v in closed), lambda v: v >= 0.95, len(closed)),
        _gate("longest discovery of two 2 h tests, warm process [s]", "≤ 60 s",
              max(seconds) if seconds else None, lambda v: v <= 60.0, len(seconds)),
    ]  # fmt: skip


def _closed(errors: dict[str, float]) -> float:
    """Return the gap closed in mean squares, relative to the true structure's [1]."""
    before = errors["before_K"] ** 2
    return (before - errors["found_K"] ** 2) / (before - errors["true_K"] ** 2)


def _is_open(errors: dict[str, float]) -> bool:
    """Whether there is a gap on the held-out test that the true structure closes."""
    return errors["before_K"] ** 2 - errors["true_K"] ** 2 > 0.1**2


def _share(values: Any) -> float | None:
    listed = [bool(v) for v in values]
    return sum(listed) / len(listed) if listed else None


def _gate(what: str, wanted: str, value: float | None, holds: Any, count: int) -> dict[str, Any]:
    return {
        "what": what,
        "gate": wanted,
        "measured": value,
        "cases": count,
        "holds": None if value is None else bool(holds(value)),
    }
