"""The gates of the discovery study, worked out from its rows."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from scipy.stats import beta

WINDING = "winding_node"
WORSE_SHARE, WORSE_K = 0.10, 0.05
"""A held-out error that grows by less than these counts as the same, as in the command."""


def is_right(row: dict[str, Any], effect: str) -> str:
    """Return `"exact"`, `"in set"` or `"missed"` for a hidden effect."""
    wanted = None if row["only_test"] is None else f"test_{row['only_test'] + 1}"
    found = [n for n in row["named"] if wanted is None or n["test"] in (None, wanted)]
    if any(named["id"] == effect for named in found):
        return "exact"
    if any(effect in named["equivalents"] for named in found):
        return "in set"
    return "missed"


def claims(row: dict[str, Any]) -> bool:
    """Whether a name is claimed."""
    return row["verdict"] in ("named", "ambiguous")


def hidden_effects(row: dict[str, Any]) -> tuple[str, ...]:
    """Return what the discovery is to name: from one node, the winding as well."""
    beside = (WINDING,) if row["group"] == "one node" else ()
    return (*beside, *row["hidden"])


def all_right(row: dict[str, Any]) -> bool:
    """Whether everything hidden is named, or in the stated sets."""
    return claims(row) and all(is_right(row, effect) != "missed" for effect in hidden_effects(row))


def gates(rows: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return each gate with what was measured, in how many cases, and its 95 % limits."""
    group = {name: [r for r in rows if r["group"] == name] for name in {r["group"] for r in rows}}

    def of(name: str) -> list[dict[str, Any]]:
        return group.get(name, [])

    shown = [
        r for r in (*of("effect"), *of("event"))
        if r["is_visible"] and r["verdict"] != "none" and r["misfit_K"] > 0.5 * r["noise_K"]
    ]  # fmt: skip
    unknown = [r for r in of("unknown") if r["is_visible"]]
    right = [is_right(r, r["hidden"][0]) if claims(r) else "missed" for r in shown]
    sizes = [1 + len(named["equivalents"]) for r in shown if claims(r) for named in r["named"]]
    closed = [_closed(r) for r in shown if claims(r) and _is_open(r)]
    bare = [r for r in of("one node") if not r["hidden"]]
    beside = [r for r in of("one node") if r["hidden"]]
    traced = [r for r in of("trace") if r["verdict"] == "adequate"]
    warm = sorted(rows, key=lambda r: r["place"])[1:]
    return [
        _share("tracebacks, or no result written", "0", "≤ 0 %",
               (r["exit_code"] != 0 or r["verdict"] == "none" for r in rows)),
        _share("any effect claimed on clean records", "≤ 5 %", "≤ 5 %",
               (claims(r) for r in of("clean"))),
        _share("visible effects: named rightly, or in the stated set", "≥ 95 %", "≥ 95 %",
               (r != "missed" for r in right)),
        _share("visible effects: exact", "≥ 85 %", "≥ 85 %", (r == "exact" for r in right)),
        _figure("mean size of the stated set", "≤ 2", sizes, np.mean),
        _share("unknown cause: flagged unexplained", "≥ 90 %", "≥ 90 %",
               (r["verdict"] == "unexplained" for r in unknown)),
        _share("unknown cause: wrongly named without a flag", "≤ 10 %", "≤ 10 %",
               (claims(r) for r in unknown)),
        _share("two effects at once: both named", "≥ 75 %", "≥ 75 %",
               (all_right(r) for r in of("pair"))),
        _share("from the first order: the winding named", "≥ 95 %", "≥ 95 %",
               (all_right(r) for r in bare)),
        _share("from the first order, a second effect beside it: both named", "≥ 75 %", "≥ 75 %",
               (all_right(r) for r in beside)),
        _share("cause in one test of several: another name without a flag", "≤ 10 %", "≤ 10 %",
               (claims(r) and not all_right(r) for r in of("in one test"))),
        _share("traces: named, or in the stated set", "–", "≥ 0 %",
               (any(r["hidden"][0] in (t["id"], *t["equivalents"]) for t in r["traces"])
                for r in traced)),
        _share("effects added that make the held-out error worse", "0", "≤ 0 %",
               (_is_worse(r) for r in rows if r["holdout"] and r["named"])),
        _figure("held-out gap closed, relative to a perfect model, median", "≥ 0.95", closed,
                np.median),
        _share("share of cases in which it is at least 0.8", "≥ 95 %", "≥ 95 %",
               (v >= 0.8 for v in closed)),
        _figure("longest command in a warm process, processor time [s]", "≤ 60",
                [r["processor_s"] for r in warm], np.max),
    ]  # fmt: skip


def _closed(row: dict[str, Any]) -> float:
    """Return the gap closed in mean squares, relative to a perfect model's [1]."""
    before, after = (row["holdout"][f"rmse_{name}_K"] ** 2 for name in ("before", "after"))
    return (before - after) / (before - row["floor_K"] ** 2)


def _is_open(row: dict[str, Any]) -> bool:
    """Whether there is a gap on the held-out test that a perfect model would close."""
    held_out = row["holdout"]
    return held_out and held_out["rmse_before_K"] ** 2 - row["floor_K"] ** 2 > 0.1**2


def _is_worse(row: dict[str, Any]) -> bool:
    before, after = (row["holdout"][f"rmse_{name}_K"] for name in ("before", "after"))
    return after > before + max(WORSE_K, WORSE_SHARE * before, 0.5 * row["noise_K"])


def limits_95(count: int, num: int) -> tuple[float, float]:
    """Return the 95 % limits of a share [1].

    Reference: C. J. Clopper, E. S. Pearson, The use of confidence or fiducial limits illustrated in
        the case of the binomial, Biometrika 26 (1934) 404-413.
    """
    low = float(beta.ppf(0.025, count, num - count + 1)) if count else 0.0
    high = float(beta.ppf(0.975, count + 1, num - count)) if count < num else 1.0
    return low, high


def _share(what: str, wanted: str, rule: str, values: Iterable[Any]) -> dict[str, Any]:
    """Return a gate on a share, with its Clopper-Pearson limits."""
    listed = [bool(value) for value in values]
    count, num = sum(listed), len(listed)
    limit = float(rule.split()[1]) / 100.0
    rate = count / num if num else None
    holds = None if rate is None else rate <= limit if rule.startswith("≤") else rate >= limit
    low, high = limits_95(count, num)
    is_proven = high <= limit if rule.startswith("≤") else low >= limit
    return {
        "what": what,
        "gate": wanted,
        "kind": "share",
        "measured": rate,
        "count": count,
        "cases": num,
        "limits_95": [low, high] if num else None,
        "is_proven": bool(num) and is_proven,
        "holds": None if wanted == "–" else holds,
    }


def _figure(what: str, wanted: str, values: Sequence[float], reduce: Any) -> dict[str, Any]:
    """Return a gate on a figure."""
    value = float(reduce(values)) if len(values) else None
    limit = float(wanted.split()[1])
    holds = None if value is None else value <= limit if "≤" in wanted else value >= limit
    return {
        "what": what,
        "gate": wanted,
        "kind": "figure",
        "measured": value,
        "cases": len(values),
        "limits_95": None,
        "is_proven": bool(len(values)),
        "holds": holds,
    }
