"""The winding at switch-off as a result: value, interval, budget, limits, and whether it stands.

Beside it stands what the usual methods by hand make of the same readings.
IEC 60034-1:2004, 8.6.2.3 (clause from memory, to be compared with the edition in force), takes the
first reading as it is where it comes within the delay; else the readings are plotted over time,
preferably with a logarithmic scale of temperature or resistance, and the curve is extrapolated to
the delay. IEEE 112 extrapolates to the instant of switch-off. What curve is drawn is left to the
hand: these are the common ones.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar, root_scalar

from ..record.motor import LIMIT_DEGC, Motor
from ..record.record import Finding
from ..results.values import BudgetRow, Part, budget, combined
from .cooling import AbstractModes, Cooling, UsualModes
from .readings import Readings

WITHIN_K = 5.0
"""What the extrapolation may add to the 95 % interval to either side [K]: half of the 10 K that
lie between class temperature and permitted rise, so that a verdict is still one."""

MOST_READINGS = 60
"""Readings that are used one by one; a logger's are averaged to so many blocks, which grow from
single readings at the beginning, where the winding cools fast."""

LEAST_SCATTER = 1.0 / 3.0
"""Of a block's mean over that of a reading [1]: what a bridge drifts by is not averaged out."""

NUM_AROUND, NUM_HALVINGS = 25, 10
"""Draws around which a first reading that was not made is judged, and steps towards its time."""

MOST_OF = 0.8
"""Share of these that a first reading must do for [1]."""

STEP = 0.05
"""Of the standard normal numbers in the finite differences of the budget."""


@dataclass(frozen=True)
class Limit:
    """What an insulation class permits, and what is left to it."""

    name: str  # In words.
    value: float  # Permitted temperature [degC] or rise [K].
    unit: str  # degC or K.
    margin_K: float  # What is left, median [K].
    margin_95_K: tuple[float, float]  # 95 % interval.
    probability: float  # That the machine is within it [1].


@dataclass(frozen=True)
class ShutdownResult:
    """The winding at the instant of switch-off."""

    motor: str  # Name of the machine.
    readings: str  # Name of the readings.
    quantity: str  # `"resistance"` or `"sensor"`.
    is_determinable: bool  # Whether the extrapolation is within `within_K`.
    reason: str  # Why not, and what would have helped; empty if it is.
    winding_degC: float  # Median.
    winding_95_degC: tuple[float, float]  # 95 % interval.
    standard_uncertainty_K: float  # Of the draws (JCGM 101).
    gum_uncertainty_K: float  # Of first order, the root of the sum of the budget (GUM).
    sink_degC: float  # What the machine cools to.
    rise_K: float  # Over the sink, median.
    rise_95_K: tuple[float, float]  # 95 % interval.
    extrapolation_95_K: float  # Half-width of the 95 % interval that the extrapolation alone has.
    within_K: float  # What it may have.
    first_reading_s: float  # Time of the first reading.
    # When it should have come at the latest; None where even the instant itself would not do.
    latest_first_reading_s: float | None
    limits: tuple[Limit, ...]  # What the classes permit.
    by_hand: tuple[ByHand, ...]  # What the methods by hand give.
    budget: tuple[BudgetRow, ...]  # Sources, the largest first.
    prior: str  # Where the prior of the time constants comes from.
    scatter_K: float  # Of a reading, median.
    time_s: np.ndarray  # Times of a curve for the figure.
    curve_degC: np.ndarray  # Its 2.5, 50 and 97.5 % quantiles, shape (3, time).
    reading_time_s: np.ndarray  # Times of the readings that were used.
    reading_degC: np.ndarray  # As temperatures.
    notes: tuple[str, ...]  # How the readings were read.
    sha256: str  # Digest of the readings.
    left_out: tuple[str, ...]  # Readings off the course of the others, in words.
    findings: tuple[Finding, ...]  # Doubts about how the file was read.


def winding_at_shutdown(
    motor: Motor,
    readings: Readings,
    modes: AbstractModes | None = None,
    *,
    within_K: float = WITHIN_K,
    seed: int = 0,
) -> ShutdownResult:
    """Extrapolate readings to the instant of switch-off.

    Args:
        motor: The machine, with `[shutdown]`.
        readings: What was read.
        modes: Prior of time constants and amplitudes; that of machines in general if None.
        within_K: Extrapolation beyond which the answer is not determinable, half-width of a 95 %
            interval [K].
        seed: Of the draws.
    """
    time_s, degC, scatter = _reduced(readings)
    prior = modes or UsualModes(rise_K=float(degC[0]) - readings.sink_degC)
    cooling = Cooling(
        time_s, degC, readings.sink_degC, motor, readings.reference_ohm, prior, scatter
    )
    z = cooling.posterior(seed)
    random = np.random.default_rng([seed, 1])
    errors = {
        key: source.sd * random.standard_normal((len(z), 1))
        for key, source in cooling.instruments.items()
    }
    shown = cooling.winding(z, np.zeros(1))
    winding = cooling.true(shown, errors)[:, 0]
    sink = readings.sink_degC + motor.shutdown.sink_sd_K * random.standard_normal(len(z))
    noise = np.median(cooling.noise_K(z), axis=0)
    rows = _budget(cooling, z)
    extrapolation = 0.5 * float(np.ptp(_interval(shown)))
    is_determinable = extrapolation <= within_K
    latest = None if is_determinable else _latest(cooling, z, noise, within_K)
    grid = np.linspace(0.0, float(time_s[-1]), 121)
    curve = cooling.true(cooling.winding(z, grid), errors)
    return ShutdownResult(
        motor=motor.name,
        readings=readings.name,
        quantity="sensor" if readings.ohm is None else "resistance",
        is_determinable=is_determinable,
        reason="" if is_determinable else _reason(time_s[0], extrapolation, within_K, latest),
        winding_degC=float(np.median(winding)),
        winding_95_degC=_interval(winding),
        standard_uncertainty_K=float(np.std(winding)),
        gum_uncertainty_K=combined(rows),
        sink_degC=readings.sink_degC,
        rise_K=float(np.median(winding - sink)),
        rise_95_K=_interval(winding - sink),
        extrapolation_95_K=extrapolation,
        within_K=within_K,
        first_reading_s=float(time_s[0]),
        latest_first_reading_s=float(time_s[0]) if is_determinable else latest,
        limits=_limits(motor, winding, winding - sink),
        by_hand=tuple(
            by_hand(
                readings.time_s,
                readings.degC,
                readings.sink_degC,
                allowed_delay_s(motor.shutdown.rated_output_kW),
            )
        ),
        budget=rows,
        prior=cooling.modes.basis,
        scatter_K=float(np.median(cooling.values(z)["noise"])),
        time_s=grid,
        curve_degC=np.quantile(curve, [0.025, 0.5, 0.975], axis=0),
        reading_time_s=time_s,
        reading_degC=degC,
        notes=readings.notes,
        sha256=readings.sha256,
        left_out=readings.left_out,
        findings=readings.findings,
    )


def _reduced(readings: Readings) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return times, temperatures, and scatter over that of a reading; means of blocks where a
    logger has written many.
    """
    num = readings.time_s.size
    if num <= MOST_READINGS:
        return readings.time_s, readings.degC, np.ones(num)
    places = np.arange(MOST_READINGS + 1)
    # the growth at which the widths 1, r, r^2, … add up to all readings
    growth = root_scalar(lambda r: np.sum(r ** places[:-1]) - num, bracket=(1, 2)).root
    ends = np.floor((growth**places - 1.0) / (growth - 1.0) + 1e-6).astype(int)
    edges = np.append(np.maximum(ends, places)[:-1], num)
    counts = np.diff(edges)
    time_s, degC = (
        np.add.reduceat(one, edges[:-1]) / counts for one in (readings.time_s, readings.degC)
    )
    return time_s, degC, np.maximum(counts**-0.5, LEAST_SCATTER)


def _interval(draws: np.ndarray) -> tuple[float, float]:
    low, high = np.quantile(draws, [0.025, 0.975])
    return float(low), float(high)


def _linear(
    cooling: Cooling, centre: np.ndarray, noise: np.ndarray, time_s: np.ndarray | None = None
) -> tuple[np.ndarray, float]:
    """Return what each standard normal number and the scatter bring to the answer near one machine
    [K], to first order.
    """
    steps = STEP * np.eye(len(cooling.names))
    both = np.concatenate([centre + steps, centre - steps])
    read = cooling.predicted(both, time_s)
    J = (read[: len(cooling.names)] - read[len(cooling.names) :]).T / (2.0 * STEP)
    J /= (noise * cooling.scatter)[:, None]
    at = cooling.winding(both, np.zeros(1))[:, 0]
    g = (at[: len(cooling.names)] - at[len(cooling.names) :]) / (2.0 * STEP)
    moved = np.linalg.solve(np.eye(len(cooling.names)) + J.T @ J, g)
    return moved, float(np.linalg.norm(J @ moved))


def _budget(cooling: Cooling, z: np.ndarray) -> tuple[BudgetRow, ...]:
    """Return the sources by the rule of `heatrun.results.values`; the readings tell nothing of the
    instruments.

    What the mean of the answer moves by with the prior mean of a number, or with a reading, is its
    covariance with that number, or with the slope of the log likelihood by that reading: exact, and
    not that of one machine in the middle, of which none of the draws may be near.
    """
    shown = cooling.winding(z, np.zeros(1))[:, 0]
    off = (shown - np.mean(shown)) / len(z)
    moved = off @ z
    sd = cooling.noise_K(z) * cooling.scatter
    scatter = float(np.linalg.norm(off @ ((cooling.predicted(z) - cooling.reading_degC) / sd)))
    at = np.array([np.mean(shown)])
    own = {source.name: source for source in (*cooling.sources.values(), cooling.sink)}
    parts = []
    for name in dict.fromkeys(cooling.names):
        places = [k for k, one in enumerate(cooling.names) if one == name]
        if name not in own:
            parts.append(Part(name, "B", float(np.linalg.norm(moved[places]))))
        elif own[name] == cooling.sources["noise"]:
            noise = float(np.median(cooling.values(z)["noise"]))
            parts.append(Part(name, "A", scatter, noise, own[name].unit))
        else:
            sd, unit = own[name].standard_uncertainty, own[name].unit
            parts.append(Part(name, "B", float(moved[places[0]]), sd, unit))
    for key, source in cooling.instruments.items():
        moves = float(cooling.true(at, {key: source.sd})[0] - at[0])
        parts.append(Part(source.name, "B", moves, source.sd, source.unit))
    return budget(parts)


def _latest(cooling: Cooling, z: np.ndarray, noise: np.ndarray, within_K: float) -> float | None:
    """Return the latest first reading that would have done [s]; None if none would.

    To first order, for most of the machines that the readings allow.
    """
    some = z[:: max(1, len(z) // NUM_AROUND)]
    came_s = cooling.time_s - cooling.time_s[0]

    def half_width(first_s: float) -> float:
        parts = (_linear(cooling, centre, noise, came_s + first_s) for centre in some)
        found = [1.96 * np.hypot(np.linalg.norm(moved), scatter) for moved, scatter in parts]
        return float(np.quantile(found, MOST_OF))

    low, high = 0.0, float(cooling.time_s[0])
    if half_width(low) > within_K:
        return None
    for _ in range(NUM_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if half_width(middle) <= within_K else (low, middle)
    return low


def _reason(first_s: float, extrapolation: float, within_K: float, latest: float | None) -> str:
    said = (
        f"the first reading comes {first_s:.0f} s after switch-off, and the extrapolation alone is "
        f"uncertain by ±{extrapolation:.1f} K (95 %), more than ±{within_K:g} K."
    )
    if latest is None or latest < 1.0:
        return f"{said} Readings with less scatter, or a calibrated run (--run), are needed."
    if latest > 0.95 * first_s:
        return f"{said} More readings, or a calibrated run (--run), would do."
    return (
        f"{said} It should have come within about {latest:.0f} s; a run (--run) helps too, and "
        "--at where the times are not from switch-off on."
    )


def _limits(motor: Motor, winding: np.ndarray, rise: np.ndarray) -> tuple[Limit, ...]:
    permitted = []
    if (letter := motor.insulation_class) is not None:
        permitted.append((f"class {letter}, temperature", LIMIT_DEGC[letter], "degC", winding))
    if said := motor.permitted_rise(float(np.median(winding - rise))):
        permitted.append((f"class {said[0]}, rise by resistance", said[1], "K", rise))
    return tuple(
        Limit(name, value, unit, float(np.median(value - seen)), _interval(value - seen),
              float(np.mean(seen <= value)))
        for name, value, unit, seen in permitted
    )  # fmt: skip


def as_content(result: ShutdownResult) -> Mapping[str, object]:
    """Return what stands in `shutdown.json`."""
    return {"format": "heatrun-shutdown/1", **vars(result)}


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
    """One method by hand."""

    method: str  # Its name.
    source: str  # Where it comes from.
    degC: float  # What it gives for the winding at `time_s`; NaN where it cannot be applied.
    time_s: float = 0.0  # Instant that is extrapolated to [s].


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
