"""One figure from its draws: value, interval and the condition it holds under, or a refusal."""

from __future__ import annotations

import numpy as np

from ..inference.plausible_effects import PlausibleEffects, of_network
from ..results.derived import DerivedFigure
from .tested import REACH_K, Tested


def figure(
    draws: np.ndarray, unit: str, condition: str, plausible: PlausibleEffects | None = None
) -> DerivedFigure:
    """Return median, standard deviation and 95 % interval of draws, some of which may be inf.

    Args:
        draws: Shape (draw,) [unit].
        unit: Their unit.
        condition: What they hold under.
        plausible: Effects behind them, where the median is to be of the network alone.
    """
    stated = of_network(plausible, draws)
    finite = np.where(np.isfinite(draws), draws, np.nan)
    if np.mean(np.isfinite(draws)) < 0.975:
        low = np.nanquantile(finite, 0.025) if np.any(np.isfinite(draws)) else np.nan
        return DerivedFigure(
            value=float(np.median(stated)),
            unit=unit,
            sd=float("nan"),
            interval_95=(float(low), float("inf")),
            condition=condition,
        )
    low, high = np.nanquantile(finite, [0.025, 0.975])
    return DerivedFigure(
        value=float(np.nanmedian(np.where(np.isfinite(stated), stated, np.nan))),
        unit=unit,
        sd=float(np.nanstd(finite)),
        interval_95=(float(low), float(high)),
        condition=condition,
    )


def refused(reason: str) -> DerivedFigure:
    """Return what stands where a figure is refused."""
    return DerivedFigure(refused=reason)


def bounded_rise(draws: np.ndarray, condition: str, seen: Tested) -> DerivedFigure:
    """Return a rise [K], refused where the tests came nowhere near it."""
    entry = figure(draws, "K", condition)
    reached = seen.winding_degC - seen.sink_degC
    if not entry.median <= reached + 3 * REACH_K:
        return refused(
            f"{entry.median:.0f} K is outside the tested range: the highest rise "
            f"measured is {reached:.0f} K"
        )
    return entry
