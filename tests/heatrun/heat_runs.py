"""Records of a motor of two nodes under load, and what a bench may do to them."""

from dataclasses import replace

import numpy as np
import pytest

from heatrun import checks
from heatrun.record.motor import Motor
from heatrun.record.record import ColumnReading, Finding, Record

MOTOR = Motor("reference", phase_resistance_ohm=0.0062)


def heat_run(
    seed: int = 0,
    minutes: float = 60.0,
    *,
    rounding: float = 1.0,
    noise: float = 0.0,
    currents: tuple[float, ...] | None = None,
    cut_off: bool = False,
    ambient: float = 22.0,
    start: float | None = None,
    drift_K_per_h: float = 0.0,
    step_s: float = 0.1,
) -> Record:
    """A two-node motor under steps of current and speed, integrated sample by sample."""
    rng = np.random.default_rng(seed)
    num = round(minutes * 60.0 / step_s)
    time_s = np.arange(num) * step_s
    if currents is None:
        pulses = np.column_stack([rng.uniform(100.0, 170.0, 8), rng.uniform(20.0, 80.0, 8)])
        currents = tuple(pulses.ravel())
    level = np.minimum((time_s / time_s[-1] * len(currents)).astype(int), len(currents) - 1)
    current = np.asarray(currents)[level]
    current[time_s < 20.0] = 0.0
    speed = rng.uniform(1000.0, 6000.0, len(currents))[level]
    if len(set(currents)) == 1:
        speed[:] = 3000.0
    P_ol = np.where(current > 0.0, 100.0 + 0.05 * speed, 0.0)
    T_0 = ambient + drift_K_per_h * time_s / 3600.0
    T_w = T_sr = ambient if start is None else start
    P_d, winding = [], []
    heat = 3.0 * 0.0062 / (234.5 + 25.0) * current**2
    # numbers of Python: those of NumPy take five times as long one by one
    for k, other, sink in zip(heat.tolist(), P_ol.tolist(), T_0.tolist(), strict=True):
        P_js = k * (234.5 + T_w)
        winding.append(T_w)
        P_d.append(P_js + other)
        flow = (T_w - T_sr) / 0.14485
        T_w += step_s * (P_js - flow) / 666.75
        T_sr += step_s * (other + flow - (T_sr - sink) / 0.11625) / 15060.1
    winding = np.array(winding) + noise * rng.standard_normal(num)
    if rounding:
        winding = (np.floor if cut_off else np.round)(winding / rounding) * rounding
    return Record(
        "run",
        {
            "time_s": time_s,
            "phase_current_A": current + 0.3 * rng.standard_normal(num),
            "losses_W": np.array(P_d) + 8.0 * rng.standard_normal(num),
            "ambient_degC": T_0 + 0.03 * rng.standard_normal(num),
            "winding_degC": winding,
            "speed_rpm": speed + 2.0 * rng.standard_normal(num),
        },
    )


CLEAN = heat_run()
SMOOTH = heat_run(rounding=0.0, noise=0.05, minutes=45.0)
STEADY = heat_run(currents=(120.0,) * 3, minutes=60.0)


def changed(record: Record, **channels: np.ndarray) -> Record:
    return replace(record, channels={**record.channels, **channels})


def decided(record: Record) -> Record:
    """The motor file gives every unit, so that none is asked about."""
    return replace(record, decided=frozenset(record.channels))


def without(record: Record, channel: str) -> Record:
    kept = {name: column for name, column in record.channels.items() if name != channel}
    return replace(record, channels=kept)


def edited(record: Record, channel: str, from_s: float, to_s: float, value: object) -> Record:
    """The record with a channel set to a value, or run through a function, over a span."""
    column = record[channel].copy()
    span = (record.time_s >= from_s) & (record.time_s < to_s)
    column[span] = value(column[span]) if callable(value) else value
    return changed(record, **{channel: column})


def late(record: Record, by_s: float) -> Record:
    """The record with its load later than its temperatures, without the ends that lack one."""
    num = round(by_s / float(np.diff(record.time_s[:2])[0]))
    behind, before = slice(abs(num), None), slice(None, record.time_s.size - abs(num))
    of_load, of_rest = (before, behind) if num > 0 else (behind, before)
    return replace(
        record,
        channels={
            name: values[of_rest if name.endswith(("_degC", "_s")) else of_load]
            for name, values in record.channels.items()
        },
    )


def as_columns(record: Record) -> Record:
    """Return a record whose channels are all columns of a file."""
    return replace(
        record,
        mapping=tuple(
            ColumnReading(name, name, "", "name", "canonical name", "t.csv")
            for name in record.channels
        ),
    )


def every(record: Record, count: int) -> Record:
    return replace(record, channels={k: v[::count] for k, v in record.channels.items()})


def at(record: Record, kept: np.ndarray) -> Record:
    return replace(record, channels={k: v[kept] for k, v in record.channels.items()})


def shifted_clock(record: Record, from_s: float, by_s: float) -> Record:
    time_s = record.time_s.copy()
    time_s[time_s >= from_s] += by_s
    return changed(record, time_s=time_s)


def fell_off(record: Record, at_s: float) -> Record:
    """The sensor hangs in the air from a moment on, with a time constant of 4 s."""
    time_s, winding = record.time_s, record["winding_degC"].copy()
    after = time_s >= at_s
    excess = winding[after][0] - 22.0
    winding[after] = np.round(22.0 + excess * np.exp(-(time_s[after] - at_s) / 4.0))
    return changed(record, winding_degC=winding)


def clipped(record: Record, channel: str, limit: float) -> Record:
    return changed(record, **{channel: np.minimum(record[channel], limit)})


def motor_and_generator(gain: float, *, brakes: bool = True) -> Record:
    """The heat run with a torque that drives and brakes in turns; its scale is off by a gain."""
    way = np.where((CLEAN.time_s // 150.0) % 2 < 1, 1.0, -1.0 if brakes else 1.0)
    power = way * 15.0 * CLEAN["losses_W"] * (CLEAN["phase_current_A"] > 0.0)
    torque = power / (CLEAN["speed_rpm"] * np.pi / 30.0)
    return changed(CLEAN, torque_Nm=torque, losses_W=CLEAN["losses_W"] + gain * power)


TIME = CLEAN.time_s
LINK = changed(CLEAN, dc_voltage_V=300.0 + 0.0 * TIME, dc_current_A=8.0 * CLEAN["losses_W"] / 300.0)
"""A speed controller: the link holds its voltage, the shaft takes seven eighths of the power."""


def named(findings: tuple[Finding, ...], id: str) -> list[Finding]:
    return [finding for finding in findings if finding.id == id]


def checked(record: Record, motor: Motor, id: str) -> list[Finding]:
    """What is told of a record under an id; the checks behind that one, which take most of the
    time and change nothing of it, are not made."""
    last = next(place for place, check in enumerate(checks.CHECKS) if check.__name__ == id)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(checks, "CHECKS", checks.CHECKS[: last + 1])
        return named(checks.check_record(record, motor), id)
