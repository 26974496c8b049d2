"""What the usual methods by hand make of the same readings.

IEC 60034-1:2004, 8.6.2.3 (clause from memory, to be compared with the edition in force), takes the
first reading as it is where it comes within the delay; else the readings are plotted over time,
preferably with a logarithmic scale of temperature or resistance, and the curve is extrapolated to
the delay. IEEE 112 extrapolates to the instant of switch-off. What curve is drawn is left to the
hand: these are the common ones.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

DELAYS_S = ((50.0, 30.0), (200.0, 90.0), (5000.0, 120.0))
"""Rated output [kW] up to which a first reading within so many seconds is taken as it is; IEC
60034-1:2004, table 5 (from memory). Above, it is subject to agreement."""

FIRST_S = 300.0
"""The part of the readings that is extrapolated by a line or a parabola [s]: as a hand would."""


BY_EYE_K, LEAST_S = 0.5, 60.0
"""By how much the first reading may lie off a line that a hand draws through the first ones [K],
and what of them it takes anyway [s]: on a logarithmic scale the course bends, and a line through
all of it would pass below the first reading."""


@dataclass(frozen=True)
class ByHand:
    """One method by hand.

    Attributes:
        method: Its name.
        source: Where it comes from.
        degC: What it gives for the winding at `time_s`; NaN where it cannot be applied.
        time_s: Instant that is extrapolated to [s].
    """

    method: str
    source: str
    degC: float
    time_s: float = 0.0


def allowed_delay_s(rated_output_kW: float | None) -> float | None:
    """Return the delay within which the first reading is taken as it is [s]; None if not known."""
    if rated_output_kW is None:
        return None
    return next((delay for most, delay in DELAYS_S if rated_output_kW <= most), None)


def by_hand(
    time_s: np.ndarray, degC: np.ndarray, sink_degC: float, delay_s: float | None = None
) -> list[ByHand]:
    """Return what each method gives.

    Args:
        time_s: Since switch-off [s], shape (time,).
        degC: Readings as temperatures, shape (time,).
        sink_degC: Temperature of the sink.
        delay_s: Delay that the standard allows [s], or None.
    """
    near = time_s <= time_s[0] + FIRST_S
    if np.sum(near) < 4:
        near = np.arange(time_s.size) < 4
    t, T = time_s[near], degC[near]
    standard = "IEC 60034-1, 8.6.2.3 (from memory), plot"
    rise = T - sink_degC
    line = _line(t, rise) if np.all(rise > 0.0) else np.full(2, np.nan)
    rows = [
        ByHand(
            "first reading as it is",
            "IEC 60034-1, 8.6.2.3 and table 5 (from memory)",
            float(degC[0]),
            float(time_s[0]),
        ),
        ByHand("logarithm of the rise, line to 0 s", standard, sink_degC + float(np.exp(line[1]))),
    ]
    if delay_s is not None and time_s[0] > delay_s:
        value = sink_degC + float(np.exp(np.polyval(line, delay_s)))
        rows.append(ByHand(f"the same, to the delay of {delay_s:.0f} s", standard, value, delay_s))
    if t.size >= 4:
        rows.append(ByHand("parabola to 0 s", "usual practice", float(np.polyfit(t, T, 2)[2])))
    rows.append(ByHand("one exponential with its own end, to 0 s", "usual practice", _single(t, T)))
    return rows


def _line(t: np.ndarray, rise: np.ndarray) -> np.ndarray:
    """Return slope and start of the line of log(rise) through as many readings as it can hold."""
    fewest = max(min(4, t.size), int(np.sum(t <= t[0] + LEAST_S)))
    line = np.full(2, np.nan)
    for num in range(t.size, fewest - 1, -1):
        line = np.polyfit(t[:num], np.log(rise[:num]), 1)
        if abs(np.exp(np.polyval(line, t[0])) - rise[0]) <= BY_EYE_K:
            break
    return line


def _single(t: np.ndarray, T: np.ndarray) -> float:
    """Return T(0) of T = c + a exp(-t/tau), least squares; the end and the drop are linear."""

    def fitted(log_tau: float) -> tuple[float, float]:
        design = np.stack([np.ones(t.size), np.exp(-t / np.exp(log_tau))], axis=1)
        found = np.linalg.lstsq(design, T, rcond=None)[0]
        return float(np.sum((design @ found - T) ** 2)), float(np.sum(found))

    times = np.linspace(np.log(1.0), np.log(1e5), 400)
    best = int(np.argmin([fitted(each)[0] for each in times]))
    ends = times[max(best - 1, 0)], times[min(best + 1, times.size - 1)]
    log_tau = minimize_scalar(lambda each: fitted(each)[0], bounds=ends, method="bounded").x
    return fitted(float(log_tau))[1]
