"""Figures that follow from the parameters: time constants, rises, continuous current, times.

Each comes with an interval and the condition it holds under, or is refused with a reason. The
other losses P_ol are taken as they were in the loaded part of the tests, because a balance says
nothing about loads that were not run.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..bench.blocks import Blocks
from ..inference.posterior import Posterior
from .duties import NUM_DRAWS, Duty, current_at_limit, parse_duty

LIMIT_DEGC = {"A": 105.0, "E": 120.0, "B": 130.0, "F": 155.0, "H": 180.0, "N": 200.0, "R": 220.0}
"""Temperature of the insulation classes [degC]; IEC 60085, table 1."""

REACH = 1.2
"""A current may lie this much above the largest one tested [1] before the figure is refused."""

REACH_K = 15.0
"""A temperature may lie this far above the highest one measured [K]."""


@dataclass(frozen=True)
class Tested:
    """What the tests have seen.

    Attributes:
        current_A: Largest rms current of a block [A].
        winding_degC: Highest reading of a block [degC].
        sink_degC: Mean temperature of the sink [degC].
        loaded_squared: Mean squared current of the loaded part [A^2].
        other_W: Mean of Pd (balance) or Pol (map) over the loaded part [W].
        loaded_winding_degC: Mean reading of the loaded part [degC].
    """

    current_A: float
    winding_degC: float
    sink_degC: float
    loaded_squared: float
    other_W: float
    loaded_winding_degC: float


def tested(tests: tuple[Blocks, ...]) -> Tested:
    """Return the range of the tests; loaded means above half of the largest squared current."""
    squared, losses, sink, winding = [], [], [], []
    for test in tests:
        rows = test.weight.shape
        squared.append(np.asarray(test.inputs.current_squared).reshape(rows).mean(axis=1))
        losses.append(np.asarray(test.inputs.losses).reshape(rows).mean(axis=1))
        sink.append(np.asarray(test.inputs.ambient).reshape(rows).mean(axis=1))
        winding.append(test.measured)
    I2, P, T0, Tw = map(np.concatenate, (squared, losses, sink, winding))
    loaded = (0.5 * np.max(I2) <= I2) & np.isfinite(Tw)
    return Tested(
        current_A=float(np.sqrt(np.max(I2))),
        winding_degC=float(np.nanmax(Tw)),
        sink_degC=float(np.mean(T0)),
        loaded_squared=float(np.mean(I2[loaded])),
        other_W=float(np.mean(P[loaded])),
        loaded_winding_degC=float(np.mean(Tw[loaded])),
    )


def derive(posterior: Posterior, duties: Sequence[str] = ()) -> dict[str, Any]:
    """Return the derived figures by name, as they stand in `fit.json`.

    Args:
        posterior: Draws.
        duties: Ratings asked for, such as `"S2-30"` and `"S3-40"`.
    """
    problem = posterior.fit.problem
    values = {name: v.ravel() for name, v in posterior.values().items()}
    size = posterior.flat.shape[0]
    for name, parameter in problem.parameters.by_test[0].items():
        if parameter.fixed is not None:
            values.setdefault(name, np.full(size, parameter.fixed))
    seen = tested(problem.tests)
    if len(problem.model.form.nodes) == 1:
        return {"tau_s": _figure(values["Ceq"] * values["Req"], "s", "Ceq Req, fixed total loss")}
    k = _slope(posterior, values, seen.loaded_squared)
    amperes = np.sqrt(seen.loaded_squared)
    other = _other_losses(posterior, values, seen)
    figures = {
        "tau_winding_s": _figure(values["Ceq_w"] * values["Req_w"], "s", "Req_w Ceq_w"),
        "tau_stator_s": _figure(values["Ceq_sr"] * values["Req_sr"], "s", "Req_sr Ceq_sr"),
    }
    for suffix, slope, text in (
        ("", 0.0 * k, "eigenvalue of the network, constant copper loss"),
        ("_feedback", k, f"eigenvalue with R(T) at {amperes:.0f} A"),
    ):
        fast, slow = _eigen_times(posterior, values, slope)
        figures[f"tau_fast{suffix}_s"] = _figure(fast, "s", text)
        figures[f"tau_slow{suffix}_s"] = _figure(slow, "s", text)
    rise = _steady_rise(posterior, values, k, other, seen.sink_degC)
    text = (
        f"{amperes:.0f} A rms, other losses {np.median(other):.0f} W, "
        f"sink {seen.sink_degC:.0f} degC"
    )
    figures["steady_rise_K"] = _bounded(rise, "K", text, seen)
    figures |= _rating(posterior, values, other, seen)
    for duty in duties:
        figures[f"{duty}_current_A"] = _duty_rating(posterior, values, other, seen, duty)
    return figures


def _slope(posterior: Posterior, values: dict, squared: float) -> np.ndarray:
    model = posterior.fit.problem.model
    return (
        model.phases * squared * values["Rs0"] / (model.coefficient + model.reference_temperature)
    )


def _other_losses(posterior: Posterior, values: dict, seen: Tested) -> np.ndarray:
    """Return P_ol of the loaded part [W]."""
    model = posterior.fit.problem.model
    channel = (1.0 + values["power_gain"]) * seen.other_W
    if model.kind == "map":
        return channel
    k = _slope(posterior, values, seen.loaded_squared)
    return channel - k * (model.coefficient + seen.loaded_winding_degC)


def _eigen_times(
    posterior: Posterior, values: dict, k: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return fast and slow time constants [s]; under a balance the feedback moves heat."""
    Cw, Cs, Rw, Rs = (values[n] for n in ("Ceq_w", "Ceq_sr", "Req_w", "Req_sr"))
    moved = k if posterior.fit.problem.model.kind == "balance" else 0.0 * k
    a, b = (k - 1 / Rw) / Cw, 1 / (Rw * Cw)
    c, d = (1 / Rw - moved) / Cs, -(1 / Rw + 1 / Rs) / Cs
    half, det = 0.5 * (a + d), a * d - b * c
    root = np.sqrt(np.maximum(half**2 - det, 0.0))
    with np.errstate(divide="ignore"):
        return 1.0 / (root - half), np.where(root + half < 0, -1.0 / (root + half), np.inf)


def _steady_rise(
    posterior: Posterior, values: dict, k: np.ndarray, other: np.ndarray, sink: float
) -> np.ndarray:
    """Return the rise of the winding at rest [K] with P_ol as given, R(T) included."""
    B = posterior.fit.problem.model.coefficient
    both = values["Req_w"] + values["Req_sr"]
    top = k * (B + sink) * both + values["Req_sr"] * other
    bottom = 1.0 - k * both
    return np.where(bottom > 0, top / np.where(bottom > 0, bottom, 1.0), np.inf)


def _rating(posterior: Posterior, values: dict, other: np.ndarray, seen: Tested) -> dict[str, Any]:
    """Return continuous current and time to the limit of the insulation class."""
    motor, model = posterior.fit.problem.motor, posterior.fit.problem.model
    if motor.insulation_class is None:
        reason = "no insulation class: give [motor] insulation_class in the motor file"
        return {"continuous_current_A": {"refused": reason},
                "time_to_limit_cold_s": {"refused": reason},
                "time_to_limit_hot_s": {"refused": reason}}  # fmt: skip
    limit = LIMIT_DEGC[motor.insulation_class]
    per_square = _slope(posterior, values, 1.0) * (model.coefficient + limit)
    both = values["Req_w"] + values["Req_sr"]
    room = limit - seen.sink_degC - values["Req_sr"] * other
    current = np.sqrt(np.maximum(room, 0.0) / (both * per_square))
    text = (
        f"class {motor.insulation_class} ({limit:.0f} degC), other losses "
        f"{np.median(other):.0f} W, sink {seen.sink_degC:.0f} degC"
    )
    continuous: dict[str, Any] = _figure(current, "A", text)
    if continuous["value"] > REACH * seen.current_A:
        continuous = {
            "refused": f"{continuous['value']:.0f} A is outside the tested range: the largest "
            f"current tested is {seen.current_A:.0f} A"
        }
    elif limit > seen.winding_degC + REACH_K:
        continuous = {
            "refused": f"the limit of {limit:.0f} degC is outside the tested range: the highest "
            f"temperature measured is {seen.winding_degC:.0f} degC"
        }
    result = {"continuous_current_A": continuous}
    amperes = float(np.sqrt(seen.loaded_squared))
    for name, start in (("cold", None), ("hot", 0.75)):
        key = f"time_to_limit_{name}_s"
        if limit > seen.winding_degC + REACH_K:
            result[key] = {"refused": continuous.get("refused", "outside the tested range")}
            continue
        times = _time_to(posterior, values, other, seen, limit, start)
        where = "from the sink's temperature" if start is None else "from 75 % of the steady rise"
        result[key] = _figure(times, "s", f"{amperes:.0f} A, {where}, {text}")
        if not np.isfinite(result[key]["value"]):
            result[key] = {"refused": f"{amperes:.0f} A does not reach {limit:.0f} degC"}
    return result


def _duty_rating(
    posterior: Posterior, values: dict, other: np.ndarray, seen: Tested, text: str
) -> dict[str, Any]:
    """Return the current of a duty type at the insulation limit; at rest there are no losses."""
    motor, model = posterior.fit.problem.motor, posterior.fit.problem.model
    duty = parse_duty(text, float(np.median(values["Ceq_sr"] * values["Req_sr"])))
    if motor.insulation_class is None:
        return {"refused": "no insulation class: give [motor] insulation_class in the motor file"}
    limit = LIMIT_DEGC[motor.insulation_class]
    picked = np.random.default_rng(0).permutation(other.size)[:NUM_DRAWS]
    Cw, Cs, Rw, Rs = (values[n][picked] for n in ("Ceq_w", "Ceq_sr", "Req_w", "Req_sr"))
    per_square = _slope(posterior, values, 1.0)[picked]
    warm, B, sink = other[picked], model.coefficient, seen.sink_degC
    longest = float(np.min(Cw * Rw)) / 10.0

    def highest(current: np.ndarray, duty: Duty) -> np.ndarray:
        Tw = np.full(current.size, sink)
        Ts, top = Tw.copy(), Tw.copy()
        for _ in range(duty.num_cycles):
            top = Tw.copy()
            for length, is_on in ((duty.on_s, 1.0), (duty.off_s, 0.0)):
                num = int(np.ceil(length / longest))
                step = length / max(num, 1)
                k = is_on * per_square * current**2
                for _ in range(num):
                    dw = (k * (B + Tw) - (Tw - Ts) / Rw) / Cw
                    ds = (is_on * warm + (Tw - Ts) / Rw - (Ts - sink) / Rs) / Cs
                    mw, ms = Tw + 0.5 * step * dw, Ts + 0.5 * step * ds
                    Tw = Tw + step * (k * (B + mw) - (mw - ms) / Rw) / Cw
                    Ts = Ts + step * (is_on * warm + (mw - ms) / Rw - (ms - sink) / Rs) / Cs
                top = np.maximum(top, Tw)
        return top

    reach = REACH * seen.current_A
    current = current_at_limit(duty, highest, limit, 2.0 * reach, picked.size)
    figure = _figure(
        current, "A", f"{text}, class {motor.insulation_class} ({limit:.0f} degC), other losses "
        f"{np.median(other):.0f} W under load, none at rest, sink {sink:.0f} degC"
    )  # fmt: skip
    if not figure["value"] <= reach:
        return {
            "refused": f"beyond {reach:.0f} A, outside the tested range: the largest current "
            f"tested is {seen.current_A:.0f} A"
        }
    if limit > seen.winding_degC + REACH_K:
        return {
            "refused": f"the limit of {limit:.0f} degC is outside the tested range: the highest "
            f"temperature measured is {seen.winding_degC:.0f} degC"
        }
    return figure


def _time_to(
    posterior: Posterior,
    values: dict,
    other: np.ndarray,
    seen: Tested,
    limit: float,
    start: float | None,
) -> np.ndarray:
    """Return the time until the winding reaches a limit at the loaded current [s], inf if never."""
    model = posterior.fit.problem.model
    k = _slope(posterior, values, seen.loaded_squared)
    Cw, Cs, Rw, Rs = (values[n] for n in ("Ceq_w", "Ceq_sr", "Req_w", "Req_sr"))
    rise = _steady_rise(posterior, values, k, other, seen.sink_degC)
    share = 0.0 if start is None else start
    finite = np.where(np.isfinite(rise), rise, limit - seen.sink_degC)
    Tw = seen.sink_degC + share * finite
    stator = share * Rs * (other + k * (model.coefficient + seen.sink_degC + finite))
    Ts = seen.sink_degC + np.minimum(stator, share * finite)
    step = float(np.median(Cw * Rw)) / 40.0
    horizon = 6.0 * float(np.median(Cs * Rs))
    times = np.full(k.shape, np.inf)
    for number in range(1, int(horizon / step) + 1):
        dw = (k * (model.coefficient + Tw) - (Tw - Ts) / Rw) / Cw
        ds = (other + (Tw - Ts) / Rw - (Ts - seen.sink_degC) / Rs) / Cs
        mw, ms = Tw + 0.5 * step * dw, Ts + 0.5 * step * ds
        Tw = Tw + step * (k * (model.coefficient + mw) - (mw - ms) / Rw) / Cw
        Ts = Ts + step * (other + (mw - ms) / Rw - (ms - seen.sink_degC) / Rs) / Cs
        times = np.where((Tw >= limit) & ~np.isfinite(times), number * step, times)
        if np.all(np.isfinite(times)):
            break
    return times


def _figure(draws: np.ndarray, unit: str, condition: str) -> dict[str, Any]:
    finite = np.where(np.isfinite(draws), draws, np.nan)
    if np.mean(np.isfinite(draws)) < 0.975:
        value = float(np.median(draws))
        return {"value": value, "unit": unit, "sd": float("nan"),
                "interval_95": [float(np.nanquantile(finite, 0.025)) if np.any(np.isfinite(draws))
                                else float("nan"), float("inf")],
                "condition": condition}  # fmt: skip
    return {
        "value": float(np.nanmedian(finite)),
        "unit": unit,
        "sd": float(np.nanstd(finite)),
        "interval_95": [float(q) for q in np.nanquantile(finite, [0.025, 0.975])],
        "condition": condition,
    }


def _bounded(draws: np.ndarray, unit: str, condition: str, seen: Tested) -> dict[str, Any]:
    figure = _figure(draws, unit, condition)
    reached = seen.winding_degC - seen.sink_degC
    if not figure["value"] <= reached + 3 * REACH_K:
        return {
            "refused": f"{figure['value']:.0f} K is outside the tested range: the highest rise "
            f"measured is {reached:.0f} K"
        }
    return figure
