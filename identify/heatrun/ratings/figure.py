"""One figure from its draws: value, interval and the condition it holds under, or a refusal."""

from __future__ import annotations

from typing import Any

import numpy as np

from .tested import REACH_K, Tested


def figure(draws: np.ndarray, unit: str, condition: str) -> dict[str, Any]:
    """Return median, standard deviation and 95 % interval of draws, some of which may be inf."""
    finite = np.where(np.isfinite(draws), draws, np.nan)
    if np.mean(np.isfinite(draws)) < 0.975:
        low = np.nanquantile(finite, 0.025) if np.any(np.isfinite(draws)) else np.nan
        return {
            "value": float(np.median(draws)),
            "unit": unit,
            "sd": float("nan"),
            "interval_95": [float(low), float("inf")],
            "condition": condition,
        }
    return {
        "value": float(np.nanmedian(finite)),
        "unit": unit,
        "sd": float(np.nanstd(finite)),
        "interval_95": [float(q) for q in np.nanquantile(finite, [0.025, 0.975])],
        "condition": condition,
    }


def refused(reason: str) -> dict[str, Any]:
    """Return what stands where a figure is refused."""
    return {"refused": reason}


def bounded_rise(draws: np.ndarray, condition: str, seen: Tested) -> dict[str, Any]:
    """Return a rise [K], refused where the tests came nowhere near it."""
    entry = figure(draws, "K", condition)
    reached = seen.winding_degC - seen.sink_degC
    if not entry["value"] <= reached + 3 * REACH_K:
        return refused(
            f"{entry['value']:.0f} K is outside the tested range: the highest rise "
            f"measured is {reached:.0f} K"
        )
    return entry
