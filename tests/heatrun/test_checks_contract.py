"""Each check keeps silent on a clean heat run and finds its own fault where it was put."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from heatrun.bench.checks import CHECKS, check_record, excitation
from heatrun.bench.checks.crude_fit import crude_fit
from heatrun.bench.record import ColumnReading, Finding, Record
from heatrun.motor import Motor, ParameterOverride

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
    P_d, winding = np.empty(num), np.empty(num)
    heat = 3.0 * 0.0062 / (234.5 + 25.0) * current**2
    for i in range(num):
        P_js = heat[i] * (234.5 + T_w)
        winding[i], P_d[i] = T_w, P_js + P_ol[i]
        flow = (T_w - T_sr) / 0.14485
        T_w += step_s * (P_js - flow) / 666.75
        T_sr += step_s * (P_ol[i] + flow - (T_sr - T_0[i]) / 0.11625) / 15060.1
    winding += noise * rng.standard_normal(num)
    if rounding:
        winding = (np.floor if cut_off else np.round)(winding / rounding) * rounding
    return Record(
        "run",
        {
            "time_s": time_s,
            "phase_current_A": current + 0.3 * rng.standard_normal(num),
            "losses_W": P_d + 8.0 * rng.standard_normal(num),
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


def without(record: Record, channel: str) -> Record:
    kept = {name: column for name, column in record.channels.items() if name != channel}
    return replace(record, channels=kept)


def edited(record: Record, channel: str, from_s: float, to_s: float, value: object) -> Record:
    """The record with a channel set to a value, or run through a function, over a span."""
    column = record[channel].copy()
    span = (record.time_s >= from_s) & (record.time_s < to_s)
    column[span] = value(column[span]) if callable(value) else value
    return changed(record, **{channel: column})


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
JITTER = TIME + 0.03 * np.random.default_rng(1).uniform(-1.0, 1.0, TIME.size)
NO_BALANCE = replace(MOTOR, losses="map")
HEATED = (TIME > 600.0) & (TIME < 900.0)  # at standstill under 100 A, copper loss alone
LOCKED = changed(
    CLEAN,
    speed_rpm=np.where(HEATED, 0.0, CLEAN["speed_rpm"]),
    phase_current_A=np.where(HEATED, 100.0, CLEAN["phase_current_A"]),
    losses_W=np.where(
        HEATED, 3.0 * 0.0062 * (234.5 + CLEAN["winding_degC"]) / 259.5 * 100.0**2, CLEAN["losses_W"]
    ),
)  # a speed controller: the link holds its voltage, and the shaft takes seven eighths of the power
RIPPLE = np.random.default_rng(3).uniform(7.0, 10.0, TIME.size)
LINK = changed(CLEAN, dc_voltage_V=300.0 + 0.0 * TIME, dc_current_A=8.0 * CLEAN["losses_W"] / 300.0)

# id: record with the fault, motor, severity, value that says where or how much, its bounds
FAULTS: dict[str, tuple[Record, Motor, str, str, tuple[float, float]]] = {
    "missing_channel": (without(CLEAN, "losses_W"), MOTOR, "error", "", (0, 0)),
    "simulated_by_heatrun": (
        replace(CLEAN, unused=("copper_loss_W", "other_loss_W", "flow_stator_ambient_W")),
        MOTOR, "warning", "", (0, 0),
    ),
    "too_few_samples": (every(CLEAN, 12000), MOTOR, "error", "num_usable", (3, 3)),
    "time_backwards": (shifted_clock(CLEAN, 900.0, -60.0), MOTOR, "error", "from_s", (899, 900)),
    "time_duplicate": (
        changed(CLEAN, time_s=np.floor(TIME)), MOTOR, "error", "share", (0.85, 0.95)
    ),
    "time_gap": (shifted_clock(CLEAN, 900.0, 60.0), MOTOR, "warning", "from_s", (899, 900)),
    "time_jitter": (changed(CLEAN, time_s=JITTER), MOTOR, "note", "relative_spread", (0.15, 0.35)),
    "sampling": (every(CLEAN, 200), MOTOR, "warning", "step_s", (20, 20)),
    "nan_block": (
        edited(CLEAN, "winding_degC", 600.0, 630.0, np.nan), MOTOR, "error", "longest_s", (29, 31)
    ),
    "units_temperature": (
        changed(
            CLEAN,
            winding_degC=CLEAN["winding_degC"] + 273.15,
            ambient_degC=CLEAN["ambient_degC"] + 273.15,
        ),
        MOTOR, "error", "as_degC", (20, 24),
    ),
    "unit_suspected": (
        changed(CLEAN, time_s=CLEAN.time_s / 3600.0), MOTOR, "error", "factor_time_s_h",
        (3600, 3600),
    ),
    "unit_assumed": (
        replace(
            CLEAN,
            mapping=(ColumnReading("time_s", "t", "s", "assumed", "names of the time", "run.csv"),),
        ),
        MOTOR, "note", "num_columns", (1, 1),
    ),
    "ambient_implausible": (
        changed(CLEAN, ambient_degC=CLEAN["winding_degC"], winding_degC=CLEAN["ambient_degC"]),
        MOTOR, "error", "", (0, 0),
    ),
    "sensor_stuck": (
        edited(CLEAN, "winding_degC", 300.0, 700.0, 60.0), MOTOR, "error", "from_s", (200, 320)
    ),
    "sensor_detached": (fell_off(CLEAN, 2000.0), MOTOR, "error", "to_s", (2000, 2010)),
    "temperature_jump": (
        edited(CLEAN, "winding_degC", 1500.0, 1e9, lambda T: T + 6.0),
        MOTOR, "error", "from_s", (1499, 1501),
    ),
    "saturation": (
        clipped(CLEAN, "losses_W", np.quantile(CLEAN["losses_W"], 0.97)),
        MOTOR, "warning", "num_samples", (500, 1200),
    ),
    "resolution": (CLEAN, MOTOR, "note", "step_K", (1, 1)),
    "truncation": (
        heat_run(ambient=22.8, cut_off=True), MOTOR, "warning", "offset_K", (-0.85, -0.75)
    ),
    "losses_negative": (
        edited(CLEAN, "losses_W", 1000.0, 1120.0, lambda P: -P),
        MOTOR, "error", "from_s", (995, 1015),
    ),
    "losses_below_copper": (
        changed(CLEAN, phase_current_A=CLEAN["phase_current_A"] * np.sqrt(2.0)),
        MOTOR, "error", "copper_share", (1.03, 2.0),
    ),
    "current_amplitude": (
        changed(CLEAN, phase_current_A=CLEAN["phase_current_A"] * np.sqrt(2.0)),
        MOTOR, "warning", "copper_share_halved", (0.5, 1.0),
    ),
    "standstill_losses": (
        edited(LOCKED, "losses_W", 600.0, 900.0, lambda P: 1.06 * P),
        MOTOR, "warning", "ratio", (1.055, 1.065),
    ),
    "losses_absent": (
        changed(CLEAN, losses_W=0.0 * TIME, phase_current_A=0.0 * TIME),
        MOTOR, "error", "rise_K", (30, 150),
    ),
    "losses_of_dc_link": (
        changed(LINK, losses_W=8.0 * CLEAN["losses_W"]), MOTOR, "warning", "ratio", (0.99, 1.01)
    ),
    "losses_absurd": (
        changed(CLEAN, losses_W=3000.0 * CLEAN["losses_W"]), MOTOR, "error",
        "largest_W", (2e6, 5e6)
    ),
    "columns_disagree": (
        as_columns(changed(
            CLEAN, i_d_A=0.0 * TIME, i_q_A=CLEAN["phase_current_A"],
        )),
        MOTOR, "error", "ratio", (1.41, 1.42)
    ),
    "shaft_power_disagrees": (
        motor_and_generator(0.03), MOTOR, "warning", "gain", (0.028, 0.032)
    ),
    "no_heating": (
        changed(CLEAN, winding_degC=CLEAN["ambient_degC"]), MOTOR, "error", "rise_K", (0, 1)
    ),
    "start_not_in_equilibrium": (heat_run(start=35.0), MOTOR, "warning", "excess_K", (12, 14)),
    "ambient_moving": (heat_run(drift_K_per_h=3.0), MOTOR, "warning", "slope_K_per_h", (2.8, 3.2)),
    "single_step": (STEADY, MOTOR, "warning", "current_A", (119, 121)),
    "too_short": (heat_run(minutes=12.0), MOTOR, "warning", "time_constants", (0.1, 0.75)),
}  # fmt: skip


STRETCHED = edited(CLEAN, "winding_degC", 2700.0, 1e9, CLEAN["winding_degC"][27000])
LIMIT = float(np.quantile(CLEAN["winding_degC"], 0.9))

# The same faults in another form: id, record, motor, severity expected (None: silent)
VARIANTS: dict[str, tuple[str, Record, Motor, str | None]] = {
    "one NaN": (
        "nan_block", edited(CLEAN, "losses_W", 600.0, 600.1, np.nan), MOTOR, "warning"
    ),
    "NaN in a spare channel": (
        "nan_block", edited(CLEAN, "speed_rpm", 0.0, 900.0, np.nan), MOTOR, "note"
    ),
    "infinite losses": (
        "nan_block", edited(CLEAN, "losses_W", 600.0, 640.0, np.inf), MOTOR, "error"
    ),
    "row written twice": (
        "time_duplicate", at(CLEAN, np.sort(np.append(np.arange(TIME.size), 999))),
        MOTOR, "warning",
    ),
    "six minutes missing": ("time_gap", shifted_clock(CLEAN, 900.0, 360.0), MOTOR, "error"),
    "stuck to the end": ("sensor_stuck", STRETCHED, MOTOR, "error"),
    "stuck and flickering elsewhere": (
        "sensor_stuck",
        edited(SMOOTH, "winding_degC", 900.0, 912.0, SMOOTH["winding_degC"][9000]),
        MOTOR, "warning",
    ),
    "constant": ("sensor_stuck", edited(CLEAN, "winding_degC", 0, 1e9, 22.0), MOTOR, "error"),
    "plateau at 1 degC": ("sensor_stuck", STEADY, MOTOR, None),
    "open circuit": (
        "sensor_detached", edited(CLEAN, "winding_degC", 800.0, 805.0, 1372.0), MOTOR, "error"
    ),
    "counter overflow": (
        "sensor_detached", edited(CLEAN, "winding_degC", 800.0, 805.0, -327.68), MOTOR, "error"
    ),
    "spike": (
        "temperature_jump", edited(CLEAN, "winding_degC", 800.0, 800.15, 140.0), MOTOR, "warning"
    ),
    "rounded reading clipped": (
        "saturation", clipped(CLEAN, "winding_degC", np.floor(LIMIT)), MOTOR, "error"
    ),
    "live reading clipped": (
        "saturation",
        clipped(SMOOTH, "winding_degC", float(np.quantile(SMOOTH["winding_degC"], 0.9))),
        MOTOR, "error",
    ),
    "tenths": ("resolution", heat_run(rounding=0.1, minutes=30.0), MOTOR, "note"),
    "unrounded": ("resolution", SMOOTH, MOTOR, None),
    "one degree": ("truncation", CLEAN, MOTOR, "note"),
    "one negative sample": (
        "losses_negative", edited(CLEAN, "losses_W", 800.0, 800.1, -900.0), MOTOR, "warning"
    ),
    "losses from a map": (
        "losses_below_copper",
        changed(CLEAN, losses_W=0.2 * CLEAN["losses_W"]), NO_BALANCE, None,
    ),
    "losses low for two minutes": (
        "losses_below_copper",
        edited(CLEAN, "losses_W", 20.0, 140.0, lambda P: 0.5 * P), MOTOR, "warning",
    ),
    "standstill that agrees": ("standstill_losses", LOCKED, MOTOR, "note"),
    "Fahrenheit": (
        "units_temperature",
        changed(
            CLEAN,
            winding_degC=32.0 + 1.8 * CLEAN["winding_degC"],
            ambient_degC=32.0 + 1.8 * CLEAN["ambient_degC"],
        ),
        MOTOR, "error",
    ),
    "Fahrenheit in the winding alone": (
        "units_temperature",
        changed(CLEAN, winding_degC=32.0 + 1.8 * CLEAN["winding_degC"]), MOTOR, "warning",
    ),
    "Fahrenheit in the ambient alone": (
        "units_temperature",
        changed(CLEAN, ambient_degC=32.0 + 1.8 * CLEAN["ambient_degC"]), MOTOR, "error",
    ),
    "chamber at 70 degC, unit declared": (
        "units_temperature",
        heat_run(ambient=70.0, minutes=30.0),
        replace(MOTOR, columns={"ambient_degC": "T_amb [degC]"}), "warning",
    ),
    "ambient of 300 degC": (
        "ambient_implausible", changed(CLEAN, ambient_degC=TIME * 0.0 + 340.0), MOTOR, "error"
    ),
    "no losses, warmed by the room": (
        "losses_absent",
        changed(
            CLEAN,
            losses_W=0.0 * TIME,
            phase_current_A=0.0 * TIME,
            ambient_degC=CLEAN["winding_degC"] + 3.0,
        ),
        MOTOR, None,
    ),
    "no losses, cooling curve": (
        "losses_absent",
        changed(
            heat_run(start=90.0, currents=(0.0, 0.0), minutes=30.0),
            losses_W=np.zeros(18000), phase_current_A=np.zeros(18000),
        ),
        MOTOR, None,
    ),
    "copper alone": ("losses_absent", changed(CLEAN, losses_W=0.0 * TIME), NO_BALANCE, None),
    "link whose current varies from sample to sample": (
        "losses_of_dc_link",
        changed(
            CLEAN,
            phase_current_A=0.0 * TIME,
            losses_W=300.0 * RIPPLE, dc_voltage_V=300.0 + 0.0 * TIME, dc_current_A=RIPPLE,
        ),
        MOTOR, "warning",
    ),
    "balance behind a link": ("losses_of_dc_link", LINK, MOTOR, None),
    "coil under direct current": (
        "losses_of_dc_link",
        changed(
            CLEAN,
            dc_voltage_V=CLEAN["losses_W"] / np.maximum(CLEAN["phase_current_A"], 1.0),
            dc_current_A=np.maximum(CLEAN["phase_current_A"], 1.0),
        ),
        MOTOR, None,
    ),
    "coil at a held voltage": (
        "losses_of_dc_link",
        changed(
            CLEAN,
            losses_W=300.0 * 2000.0 / (234.5 + CLEAN["winding_degC"]),
            dc_voltage_V=300.0 + 0.0 * TIME,
            dc_current_A=2000.0 / (234.5 + CLEAN["winding_degC"]),
        ),
        MOTOR, None,
    ),
    "phase current read from the link": (
        "losses_of_dc_link",
        changed(
            without(LINK, "dc_current_A"),
            phase_current_A=LINK["dc_current_A"], losses_W=8.0 * CLEAN["losses_W"],
        ),
        MOTOR, "warning",
    ),
    "cooling curve": (
        "no_heating", heat_run(start=90.0, currents=(0.0, 0.0), minutes=30.0), MOTOR, "warning"
    ),
    "load and cool-down": (
        "single_step", heat_run(currents=(130.0, 130.0, 0.0), minutes=30.0), MOTOR, None
    ),
    "one level for 15 min": (
        "too_short", heat_run(currents=(130.0,), minutes=15.0), MOTOR, "warning"
    ),
    "torque of one scale": ("shaft_power_disagrees", motor_and_generator(0.0), MOTOR, None),
    "generator half a percent off": (
        "shaft_power_disagrees", motor_and_generator(-0.005), MOTOR, None
    ),
    "generator 4 % off": ("shaft_power_disagrees", motor_and_generator(-0.04), MOTOR, "warning"),
    "torque 5 % off": (
        "losses_below_copper", motor_and_generator(-0.05, brakes=False), MOTOR, "error"
    ),
    "torque 5 % off, and allowed to be": (
        "losses_below_copper", motor_and_generator(-0.05, brakes=False),
        replace(MOTOR, parameters={"shaft_power_gain": ParameterOverride(sd=0.04)}), "warning"
    ),
    "map of losses": (
        "shaft_power_disagrees", motor_and_generator(0.03), replace(MOTOR, losses="map"), None
    ),
    "settled": ("too_short", heat_run(currents=(100.0,), minutes=170.0, step_s=1.0), MOTOR, None),
}  # fmt: skip


def named(findings: tuple[Finding, ...], id: str) -> list[Finding]:
    return [finding for finding in findings if finding.id == id]


@pytest.mark.parametrize(
    "record",
    [
        CLEAN,
        SMOOTH,
        heat_run(1, 30.0),
        heat_run(2, 90.0, step_s=0.5),
        heat_run(3, 90.0, currents=(150.0, 100.0, 0.0), step_s=0.5),
    ],
    ids=["60 min", "unrounded", "30 min", "90 min", "cool-down"],
)
def test_clean_heat_run_gives_notes_only(record):
    doubts = [f.sentence() for f in check_record(record, MOTOR) if f.severity != "note"]
    assert doubts == []


def test_a_long_test_is_not_called_too_short_for_its_length(monkeypatch):
    """Sixty minutes, a constant of some 900 s known to a factor of 1.6: four of them, not two."""
    record = heat_run(4, 60.0, step_s=1.0)
    crude = crude_fit(record, MOTOR)
    assert crude is not None
    unsure = replace(crude, tau_s=900.0, log_sd=0.5)
    monkeypatch.setattr(excitation, "crude_fit", lambda *_: unsure)
    monkeypatch.setattr(excitation, "settling_constants", lambda *_: 0.0)
    (finding,) = named(check_record(record, MOTOR), "too_short")
    assert finding.severity == "warning"
    assert "at least two" not in finding.message
    assert "between 331 and 2446 s" in finding.message


def test_every_check_has_its_fault():
    assert {check.__name__ for check in CHECKS} == set(FAULTS)


@pytest.mark.parametrize("id", list(FAULTS))
def test_each_check_finds_its_own_fault(id):
    record, motor, severity, key, (low, high) = FAULTS[id]
    found = named(check_record(record, motor), id)
    assert [f.severity for f in found if f.severity == severity], found
    finding = next(f for f in found if f.severity == severity)
    assert finding.test == "run"
    assert "run" in finding.where
    if severity != "note":
        assert finding.remedy.endswith((".", "?"))
    if key:
        assert low <= finding.values[key] <= high
    assert all(np.isfinite(list(finding.values.values())))


@pytest.mark.parametrize("name", list(VARIANTS))
def test_the_same_fault_in_another_form(name):
    id, record, motor, severity = VARIANTS[name]
    severities = {f.severity for f in named(check_record(record, motor), id)}
    assert severities == ({severity} if severity else set())


def test_reader_findings_come_first():
    own = Finding("reader", "note", "Seen by the reader.")
    found = check_record(replace(CLEAN, findings=(own,)), MOTOR)
    assert found[0] == replace(own, test="run")
    assert len(found) > 1


def test_a_missing_loss_is_told_beside_the_power_of_the_link():
    record = without(without(LINK, "losses_W"), "phase_current_A")
    found = {f.where: f.remedy for f in named(check_record(record, MOTOR), "missing_channel")}
    assert "torque_Nm" in found["run, losses_W"]
    assert "not the loss" in found["run, losses_W"]
    assert "dc_current_A is not" in found["run, phase_current_A"]
    plain = named(check_record(without(CLEAN, "losses_W"), MOTOR), "missing_channel")
    assert "torque_Nm" not in plain[0].remedy


def test_a_test_of_seconds_is_told_that_it_is_short():
    cooling = heat_run(start=90.0, currents=(0.0, 0.0), minutes=0.12)
    (finding,) = named(check_record(cooling, MOTOR), "no_heating")
    assert finding.severity == "error"
    assert "lasts 7 s" in finding.message


def test_a_measured_stator_is_not_called_unknown():
    warm = heat_run(start=35.0)
    (alone,) = named(check_record(warm, MOTOR), "start_not_in_equilibrium")
    assert "is then unknown" in alone.message
    known = changed(warm, stator_degC=warm["winding_degC"])
    (beside,) = named(check_record(known, MOTOR), "start_not_in_equilibrium")
    assert "the stator" not in beside.message
    assert "Map `stator_degC`" not in beside.remedy


def test_coolant_replaces_ambient_where_it_is_the_sink():
    record = changed(without(CLEAN, "ambient_degC"), coolant_degC=CLEAN["ambient_degC"])
    assert named(check_record(record, MOTOR), "missing_channel")
    cooled = replace(MOTOR, sink="coolant")
    assert not [f for f in check_record(record, cooled) if f.severity != "note"]
