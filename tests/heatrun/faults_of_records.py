"""A fault for each check, and the same faults in other forms."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from heat_runs import (
    CLEAN,
    LINK,
    MOTOR,
    SMOOTH,
    STEADY,
    TIME,
    as_columns,
    at,
    changed,
    clipped,
    decided,
    edited,
    every,
    fell_off,
    heat_run,
    late,
    motor_and_generator,
    shifted_clock,
    without,
)

from heatrun.record.motor import Motor, ParameterOverride
from heatrun.record.record import ColumnReading, Record
from heatrun.record.stretch import Stretch, cut

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
)
SLID_K = np.interp(SMOOTH.time_s, [1200.0, 1260.0], [-4.0, 8.0])
RESTING = heat_run(3, 40.0, currents=(150.0, 100.0, 0.0), step_s=0.5)
TURNS = RESTING["phase_current_A"] > 10.0
RIPPLE = np.random.default_rng(3).uniform(7.0, 10.0, TIME.size)


class Fault(NamedTuple):
    record: Record
    severity: str
    value: str = ""  # Which value says where or how much, and its bounds.
    bounds: tuple[float, float] = (0.0, 0.0)
    motor: Motor = MOTOR


class Variant(NamedTuple):
    id: str
    record: Record
    severity: str | None  # None: silent.
    motor: Motor = MOTOR


CUT = cut(CLEAN, Stretch(1800.0), "test")
WARM_K = float(CUT["winding_degC"][0] - CUT["ambient_degC"][0])


def of_powers(times: float | np.ndarray, lost: float = 0.0) -> Record:
    """A record whose losses are those of its columns of power and torque, by a torque whose power
    is so many times the losses; of that share of the samples the electrical power is lost.
    """
    electrical_W = (1.0 + np.abs(times)) * CLEAN["losses_W"]
    electrical_W = np.where(np.random.default_rng(5).random(TIME.size) < lost, 0.0, electrical_W)
    record = changed(CLEAN, speed_rpm=np.full(TIME.size, 1500.0))
    return of_balance(record, electrical_W, times * CLEAN["losses_W"])


def on_two_scales(of_electrical: float = 1.0, of_torque: float = 1.0) -> Record:
    """A record whose torque goes with the current, by powers that read so many times too much."""
    shaft_W = 0.5 * CLEAN["phase_current_A"] * CLEAN["speed_rpm"] * np.pi / 30.0
    electrical_W = of_electrical * (CLEAN["losses_W"] + shaft_W)
    return of_balance(CLEAN, electrical_W, of_torque * shaft_W)


def of_balance(record: Record, electrical_W: np.ndarray, shaft_W: np.ndarray) -> Record:
    """A record as a bench has it that measures both powers."""
    torque_Nm = shaft_W / (record["speed_rpm"] * np.pi / 30.0)
    columns = as_columns(changed(record, torque_Nm=torque_Nm, electrical_power_W=electrical_W))
    mapping = tuple(one for one in columns.mapping if one.channel != "losses_W")
    return replace(changed(columns, losses_W=electrical_W - shaft_W), mapping=mapping)


PICKS_UP = changed(
    SMOOTH, winding_degC=SMOOTH["winding_degC"] - 6.0 * SMOOTH["phase_current_A"] / 160.0
)
UNDER_TORQUE = changed(STEADY, torque_Nm=np.full(STEADY.time_s.size, 0.5))
STEPS = np.flatnonzero(np.abs(np.diff(SMOOTH["phase_current_A"])) > 40.0)
SHIFTS_S = float(SMOOTH.time_s[STEPS[3] + 1])  # with a load step
SHIFTED = edited(SMOOTH, "winding_degC", SHIFTS_S, 1e9, lambda T: T + 6.0)

TURNING = changed(
    SMOOTH,
    losses_W=SMOOTH["losses_W"] + 40.0,  # of iron, whatever the current
    speed_rpm=np.full(SMOOTH.time_s.size, 1500.0),
)
TWO_PHASES = of_balance(TURNING, 8.0 / 1.5 * TURNING["losses_W"], 7.0 * TURNING["losses_W"])
REVERSED = changed(
    SMOOTH, losses_W=SMOOTH["losses_W"][::-1], phase_current_A=SMOOTH["phase_current_A"][::-1]
)
MIRRORED = changed(SMOOTH, winding_degC=44.0 - SMOOTH["winding_degC"])

FAULTS: dict[str, Fault] = {id: Fault(*each) for id, each in {
    "missing_channel": (without(CLEAN, "losses_W"), "error"),
    "simulated_by_heatrun": (
        replace(CLEAN, unused=("copper_loss_W", "other_loss_W", "flow_stator_ambient_W")),
        "warning"
    ),
    "too_few_samples": (every(CLEAN, 12000), "error", "num_usable", (3, 3)),
    "time_backwards": (shifted_clock(CLEAN, 900.0, -60.0), "error", "from_s", (899, 900)),
    "time_duplicate": (changed(CLEAN, time_s=np.floor(TIME)), "error", "share", (0.85, 0.95)),
    "time_gap": (shifted_clock(CLEAN, 900.0, 60.0), "warning", "from_s", (899, 900)),
    "time_jitter": (changed(CLEAN, time_s=JITTER), "note", "relative_spread", (0.15, 0.35)),
    "sampling": (every(CLEAN, 200), "warning", "step_s", (20, 20)),
    "load_spike": (
        edited(CLEAN, "losses_W", 1500.0, 1503.0, 65535.0), "error", "num_samples", (30, 30)
    ),
    "load_late": (late(CLEAN, 30.0), "error", "late_s", (28, 32)),
    "load_stuck": (
        edited(CLEAN, "losses_W", 1000.0, 1400.0, 431.7), "error", "from_s", (998, 1002)
    ),
    "nan_block": (
        edited(CLEAN, "winding_degC", 600.0, 630.0, np.nan), "error", "longest_s", (29, 31)
    ),
    "units_temperature": (
        changed(
            CLEAN,
            winding_degC=CLEAN["winding_degC"] + 273.15,
            ambient_degC=CLEAN["ambient_degC"] + 273.15,
        ),
        "error", "as_degC", (20, 24)
    ),
    "unit_suspected": (
        changed(CLEAN, time_s=CLEAN.time_s / 3600.0), "error", "factor_time_s_h", (3600, 3600)
    ),
    "unit_assumed": (
        replace(
            CLEAN,
            mapping=(ColumnReading("time_s", "t", "s", "assumed", "names of the time", "run.csv"),),
        ),
        "note", "num_columns", (1, 1)
    ),
    "ambient_implausible": (
        changed(CLEAN, ambient_degC=CLEAN["winding_degC"], winding_degC=CLEAN["ambient_degC"]),
        "error"
    ),
    "sensor_stuck": (
        edited(CLEAN, "winding_degC", 300.0, 700.0, 60.0), "error", "from_s", (200, 320)
    ),
    "sensor_detached": (fell_off(CLEAN, 2000.0), "error", "to_s", (2000, 2012)),
    "sensor_pickup": (PICKS_UP, "warning", "rated_K", (-6.5, -5.5)),
    "temperature_jump": (
        edited(CLEAN, "winding_degC", 1500.0, 1e9, lambda T: T + 6.0), "error", "from_s",
        (1499, 1501)
    ),
    "saturation": (
        clipped(CLEAN, "losses_W", np.quantile(CLEAN["losses_W"], 0.97)), "warning", "num_samples",
        (500, 1200)
    ),
    "resolution": (CLEAN, "note", "step_K", (1, 1)),
    "truncation": (heat_run(ambient=22.8, cut_off=True), "warning", "offset_K", (-0.85, -0.75)),
    "load_of_another": (REVERSED, "warning", "rms_K", (5.0, 20.0)),
    "losses_negative": (
        edited(CLEAN, "losses_W", 1000.0, 1120.0, lambda P: -P), "error", "from_s", (995, 1015)
    ),
    "losses_below_copper": (
        decided(changed(CLEAN, phase_current_A=CLEAN["phase_current_A"] * np.sqrt(2.0))), "error",
        "copper_share", (1.03, 2.0)
    ),
    "current_amplitude": (
        decided(changed(CLEAN, losses_W=MOTOR.copper_loss_W(
            CLEAN["phase_current_A"], CLEAN["winding_degC"]
        ))),
        "warning", "copper_share_halved", (0.49, 0.51)
    ),
    "standstill_losses": (
        edited(LOCKED, "losses_W", 600.0, 900.0, lambda P: 1.06 * P), "warning", "ratio",
        (1.055, 1.065)
    ),
    "resistance_coefficient": (
        as_columns(changed(CLEAN, winding_resistance_ohm=1e-3 * (150.0 + CLEAN["winding_degC"]))),
        "warning", "coefficient_degC", (148, 152)
    ),
    "losses_of_shaft": (
        as_columns(changed(CLEAN, torque_Nm=0.9 * CLEAN["losses_W"] / CLEAN["speed_rpm"] * 9.549)),
        "error", "ratio", (1.1, 1.12), replace(MOTOR, phase_resistance_ohm=0.002)
    ),
    "losses_absent": (
        changed(CLEAN, losses_W=0.0 * TIME, phase_current_A=0.0 * TIME), "error", "rise_K",
        (30, 150)
    ),
    "losses_of_dc_link": (
        changed(LINK, losses_W=8.0 * CLEAN["losses_W"]), "warning", "ratio", (0.99, 1.01)
    ),
    "losses_absurd": (
        decided(changed(CLEAN, losses_W=3000.0 * CLEAN["losses_W"])), "warning", "largest_W",
        (2e6, 5e6)
    ),
    "columns_disagree": (
        as_columns(changed(CLEAN, i_d_A=0.0 * TIME, i_q_A=CLEAN["phase_current_A"])), "error",
        "ratio", (1.41, 1.42)
    ),
    "shaft_power_disagrees": (
        motor_and_generator(0.03), "warning", "shaft_power_gain", (0.028, 0.032)
    ),
    "no_heating": (changed(CLEAN, winding_degC=CLEAN["ambient_degC"]), "error", "rise_K", (0, 1)),
    "start_not_in_equilibrium": (heat_run(start=35.0), "warning", "excess_K", (12, 14)),
    # as warm as the whole record is at that time
    "cut_while_warm": (CUT, "note", "excess_K", (WARM_K - 1.0, WARM_K + 1.0)),
    "ambient_moving": (heat_run(drift_K_per_h=3.0), "warning", "slope_K_per_h", (2.8, 3.2)),
    "single_step": (STEADY, "warning", "current_A", (119, 121)),
    "too_short": (heat_run(minutes=12.0), "warning", "time_constants", (0.1, 0.75)),
}.items()}  # fmt: skip


STRETCHED = edited(CLEAN, "winding_degC", 2700.0, 1e9, CLEAN["winding_degC"][27000])
PEAKED, PEAKED_SMOOTH = (
    edited(one, "winding_degC", peak_s, peak_s + 300.0, float(one["winding_degC"].max()))
    for one in (CLEAN, SMOOTH)
    for peak_s in (float(one.time_s[np.argmax(one["winding_degC"])]),)
)  # stuck where the load falls
LONG = heat_run(2, 90.0, step_s=0.5)
LOSES_CONTACT = changed(
    LONG,
    winding_degC=np.round(
        LONG["winding_degC"]
        - 0.4
        * np.clip((LONG.time_s - 2400.0) / 1500.0, 0.0, 1.0)
        * (LONG["winding_degC"] - LONG["ambient_degC"])
    ),
)
STUCK_UNDER_NOISE = edited(
    SMOOTH, "winding_degC", 900.0, 1500.0,
    lambda T: T[0] + 0.05 * np.random.default_rng(4).standard_normal(T.size),
)  # fmt: skip
LIMIT = float(np.quantile(CLEAN["winding_degC"], 0.9))

VARIANTS: dict[str, Variant] = {name: Variant(*each) for name, each in {
    "a current of no marker that the losses deny": (
        "load_spike", edited(CLEAN, "phase_current_A", 1500.0, 1500.5, 5e3), "error"
    ),
    "losses of no marker that the winding does not show": (
        "load_spike", edited(CLEAN, "losses_W", 1500.0, 1506.0, 4e4), "error"
    ),
    "losses of no marker on the first sample of a load": (
        "load_spike", edited(every(CLEAN, 20), "losses_W", 20.0, 21.0, 5e4), "error"
    ),
    "losses of no marker on the last sample of a load": (
        "load_spike", edited(every(CLEAN, 20), "losses_W", 224.0, 225.0, 5e4), "error"
    ),
    "a torque under a current that stays": (
        "load_spike", edited(UNDER_TORQUE, "torque_Nm", 1500.0, 1500.5, 60.0), "error"
    ),
    "a record that begins with the end of a load": (
        "load_spike", edited(UNDER_TORQUE, "torque_Nm", 0.0, 0.5, 60.0), None
    ),
    "an inrush": ("load_spike", edited(CLEAN, "phase_current_A", 20.0, 20.2, 600.0), None),
    "shifted by less than any machine moves in a second": (
        "temperature_jump",
        edited(every(CLEAN, 50), "winding_degC", 1520.0, 1e9, lambda T: T - 12.0), "error"
    ),
    "a line that picks up the current, no jumps": ("temperature_jump", PICKS_UP, None),
    "one shift with a load step": ("temperature_jump", SHIFTED, "error"),
    "a shift of less than a second's heat with a load step": (
        "temperature_jump",
        edited(every(SMOOTH, 10), "winding_degC", SHIFTS_S, 1e9, lambda T: T + 4.0), "error"
    ),
    "one shift with a load step, no pickup": ("sensor_pickup", SHIFTED, None),
    "below the housing": (
        "sensor_detached", changed(SMOOTH, housing_degC=SMOOTH["winding_degC"] + SLID_K), "error"
    ),
    "contact lost over 25 min": ("sensor_detached", LOSES_CONTACT, "warning"),
    "contact lost over 25 min and no late load": ("load_late", LOSES_CONTACT, None),
    "one NaN": ("nan_block", edited(CLEAN, "losses_W", 600.0, 600.1, np.nan), "note"),
    "NaN in a spare channel": ("nan_block", edited(CLEAN, "speed_rpm", 0.0, 900.0, np.nan), "note"),
    "infinite losses": ("nan_block", edited(CLEAN, "losses_W", 600.0, 640.0, np.inf), "error"),
    "row written twice": (
        "time_duplicate", at(CLEAN, np.sort(np.append(np.arange(TIME.size), 999))), "warning"
    ),
    "cut with a measured stator": (
        "cut_while_warm", changed(CUT, stator_degC=CUT["winding_degC"]), None
    ),
    "cut at the end": ("cut_while_warm", cut(CLEAN, Stretch(0.0, 1800.0), "test"), None),
    "cut before the load": ("cut_while_warm", cut(CLEAN, Stretch(10.0), "test"), None),
    "an hour missing, and no reading that stands still over it": (
        "sensor_stuck", shifted_clock(every(CLEAN, 10), 1800.0, 3600.0), None
    ),
    "six minutes missing": ("time_gap", shifted_clock(CLEAN, 900.0, 360.0), "error"),
    "stuck to the end": ("sensor_stuck", STRETCHED, "error"),
    "stuck at its highest": ("sensor_stuck", PEAKED_SMOOTH, "error"),
    "stuck at its highest, rounded": ("sensor_stuck", PEAKED, "error"),
    "stuck and not clipped": ("saturation", PEAKED_SMOOTH, None),
    "stuck, rounded and not clipped": ("saturation", PEAKED, None),
    "stuck and flickering elsewhere": (
        "sensor_stuck", edited(SMOOTH, "winding_degC", 900.0, 912.0, SMOOTH["winding_degC"][9000]),
        "warning"
    ),
    "constant": ("sensor_stuck", edited(CLEAN, "winding_degC", 0, 1e9, 22.0), "error"),
    "stuck under its noise": ("sensor_stuck", STUCK_UNDER_NOISE, "error"),
    "stuck under its noise and no jump": ("temperature_jump", STUCK_UNDER_NOISE, None),
    "stuck under its noise and not detached": ("sensor_detached", STUCK_UNDER_NOISE, None),
    "plateau under noise": (
        "sensor_stuck", heat_run(currents=(120.0,) * 3, rounding=0.0, noise=0.2), None
    ),
    "plateau at 1 degC": ("sensor_stuck", STEADY, None),
    "open circuit": (
        "sensor_detached", edited(CLEAN, "winding_degC", 800.0, 805.0, 1372.0), "error"
    ),
    "counter overflow": (
        "sensor_detached", edited(CLEAN, "winding_degC", 800.0, 805.0, -327.68), "error"
    ),
    "spike": ("temperature_jump", edited(CLEAN, "winding_degC", 800.0, 800.15, 140.0), "warning"),
    "rounded reading clipped": (
        "saturation", clipped(CLEAN, "winding_degC", np.floor(LIMIT)), "error"
    ),
    "live reading clipped": (
        "saturation",
        clipped(SMOOTH, "winding_degC", float(np.quantile(SMOOTH["winding_degC"], 0.9))), "error"
    ),
    "tenths": ("resolution", heat_run(rounding=0.1, minutes=30.0), "note"),
    "unrounded": ("resolution", SMOOTH, None),
    "one degree": ("truncation", CLEAN, "note"),
    "one negative sample": (
        "losses_negative", edited(CLEAN, "losses_W", 800.0, 800.1, -900.0), "warning"
    ),
    "losses from a map": (
        "losses_below_copper", changed(CLEAN, losses_W=0.2 * CLEAN["losses_W"]), None, NO_BALANCE
    ),
    "losses low for two minutes": (
        "losses_below_copper", edited(CLEAN, "losses_W", 20.0, 140.0, lambda P: 0.5 * P), "warning"
    ),
    "standstill that agrees": ("standstill_losses", LOCKED, "note"),
    "chamber at 70 degC, unit declared": (
        "units_temperature",
        replace(
            heat_run(ambient=70.0, minutes=30.0),
            mapping=(
                ColumnReading("ambient_degC", "T_amb", "degC", "stated", "[columns]", "run.csv"),
            ),
            decided=frozenset({"ambient_degC"}),
        ),
        "warning"
    ),
    "chamber at 70 degC, unit in its heading alone": (
        "units_temperature",
        replace(
            heat_run(ambient=70.0, minutes=30.0),
            mapping=(
                ColumnReading("ambient_degC", "T_amb [degC]", "degC", "stated", "map", "run.csv"),
            ),
        ),
        "error"
    ),
    "ambient and winding of one sensor": (
        "ambient_implausible",
        changed(CLEAN, ambient_degC=CLEAN["winding_degC"] + 0.05 * np.sin(TIME)), "error"
    ),
    "winding close above oil that it warms": (
        "ambient_implausible",
        changed(
            CLEAN, ambient_degC=22.0 + 0.4 * (CLEAN["winding_degC"] - CLEAN["winding_degC"][0])
        ),
        None
    ),
    "ambient of 300 degC": (
        "ambient_implausible", changed(CLEAN, ambient_degC=TIME * 0.0 + 340.0), "error"
    ),
    "no losses, warmed by the room": (
        "losses_absent",
        changed(
            CLEAN,
            losses_W=0.0 * TIME,
            phase_current_A=0.0 * TIME,
            ambient_degC=CLEAN["winding_degC"] + 3.0,
        ),
        None
    ),
    "no losses, cooling curve": (
        "losses_absent",
        changed(
            heat_run(start=90.0, currents=(0.0, 0.0), minutes=30.0),
            losses_W=np.zeros(18000), phase_current_A=np.zeros(18000),
        ),
        None
    ),
    "copper alone": ("losses_absent", changed(CLEAN, losses_W=0.0 * TIME), None, NO_BALANCE),
    "link whose current varies from sample to sample": (
        "losses_of_dc_link",
        changed(
            CLEAN,
            phase_current_A=0.0 * TIME,
            losses_W=300.0 * RIPPLE, dc_voltage_V=300.0 + 0.0 * TIME, dc_current_A=RIPPLE,
        ),
        "warning"
    ),
    "balance behind a link": ("losses_of_dc_link", LINK, None),
    "coil under direct current": (
        "losses_of_dc_link",
        changed(
            CLEAN,
            dc_voltage_V=CLEAN["losses_W"] / np.maximum(CLEAN["phase_current_A"], 1.0),
            dc_current_A=np.maximum(CLEAN["phase_current_A"], 1.0),
        ),
        None
    ),
    "coil at a held voltage": (
        "losses_of_dc_link",
        changed(
            CLEAN,
            losses_W=300.0 * 2000.0 / (234.5 + CLEAN["winding_degC"]),
            dc_voltage_V=300.0 + 0.0 * TIME,
            dc_current_A=2000.0 / (234.5 + CLEAN["winding_degC"]),
        ),
        None
    ),
    "phase current read from the link": (
        "losses_of_dc_link",
        changed(
            without(LINK, "dc_current_A"),
            phase_current_A=LINK["dc_current_A"], losses_W=8.0 * CLEAN["losses_W"],
        ),
        "warning"
    ),
    "cooling curve": (
        "no_heating", heat_run(start=90.0, currents=(0.0, 0.0), minutes=30.0), "warning"
    ),
    "load and cool-down": (
        "single_step", heat_run(currents=(130.0, 130.0, 0.0), minutes=30.0), None
    ),
    "load and cool-down in two minutes": (
        "too_short", heat_run(currents=(150.0, 0.0), minutes=1.9), "warning"
    ),
    "one level for 15 min": ("too_short", heat_run(currents=(130.0,), minutes=15.0), "warning"),
    "torque that brakes": ("shaft_power_disagrees", of_powers(-5.0), "error"),
    "torque that drives": ("shaft_power_disagrees", of_powers(5.0), None),
    "torque whose sign changes in the midst": (
        "shaft_power_disagrees", of_powers(np.where(TIME < 1800.0, 5.0, -5.0)), "error"
    ),
    "torque that brakes for 20 s": (
        "shaft_power_disagrees", of_powers(np.where((TIME < 1800.0) | (TIME > 1820.0), 5.0, -5.0)),
        None
    ),
    "a current transformer set to twice its ratio": (
        "losses_of_shaft", on_two_scales(of_electrical=2.0), "warning"
    ),
    "pound-feet taken for newton metres": (
        "losses_of_shaft", on_two_scales(of_torque=0.7376), "warning"
    ),
    "a torque that reads 5 % too little": ("losses_of_shaft", on_two_scales(of_torque=0.95), None),
    "messages of the power lost": ("load_spike", of_powers(5.0, lost=3e-3), "error"),
    "no message of the power lost": ("load_spike", of_powers(5.0), None),
    "load of some minutes not recorded": (
        "load_stuck",
        edited(edited(STEADY, "losses_W", 1000.0, 1400.0, 0.0), "phase_current_A", 1000.0, 1400.0,
               0.0),
        "error"
    ),
    "losses that are stated": (
        "load_stuck",
        changed(RESTING, losses_W=0.0 * RESTING.time_s + 300.0,
                speed_rpm=np.where(TURNS, RESTING["speed_rpm"], 0.0),
                phase_current_A=np.where(TURNS, RESTING["phase_current_A"], 0.0)),
        "error"
    ),
    "a load that stops": (
        "load_stuck",
        changed(RESTING, speed_rpm=np.where(TURNS, RESTING["speed_rpm"], 0.0),
                phase_current_A=np.where(TURNS, RESTING["phase_current_A"], 0.0)),
        None
    ),
    "load that is set": (
        "load_stuck",
        changed(
            edited(edited(CLEAN, "losses_W", 1000.0, 1400.0, 431.7),
                   "phase_current_A", 1000.0, 1400.0, 99.0),
            speed_rpm=np.full(TIME.size, 1500.0),
        ),
        "warning"
    ),
    "no load": (
        "load_stuck",
        edited(edited(CLEAN, "losses_W", 1000.0, 1400.0, 0.0), "phase_current_A", 1000.0, 1400.0,
               0.0),
        None
    ),
    "load that is early, or sensor that is late": ("load_late", late(CLEAN, -30.0), None),
    "no power under current": (
        "load_stuck", edited(CLEAN, "losses_W", 1000.0, 1060.0, 0.0), "error"
    ),
    "power held for half a minute": (
        "load_stuck", edited(CLEAN, "losses_W", 1000.0, 1030.0, 431.7), None
    ),
    "ambient open for a while": (
        "sensor_detached", edited(CLEAN, "ambient_degC", 1000.0, 1100.0, 850.0), "error"
    ),
    "ambient that reads nothing": (
        "sensor_detached", changed(CLEAN, ambient_degC=0.0 * TIME), "error"
    ),
    "winding that reads nothing": (
        "sensor_detached", edited(CLEAN, "winding_degC", 1000.0, 1000.5, 0.0), "error"
    ),
    "winding that begins at 0 degC": ("sensor_detached", heat_run(start=0.0), None),
    "torque of one scale": ("shaft_power_disagrees", motor_and_generator(0.0), None),
    "generator half a percent off": ("shaft_power_disagrees", motor_and_generator(-0.005), None),
    "zero of the torque, read at rest": (
        "shaft_power_disagrees",
        as_columns(changed(RESTING, torque_Nm=20.0 * TURNS + 0.4,
                           speed_rpm=RESTING["speed_rpm"] * TURNS)),
        "warning"
    ),
    "generator 4 % off": ("shaft_power_disagrees", motor_and_generator(-0.04), "warning"),
    "torque 5 % off": (
        "losses_below_copper", decided(motor_and_generator(-0.05, brakes=False)), "error"
    ),
    "torque 12 % off, losses below zero": (
        "losses_negative", decided(motor_and_generator(-0.12, brakes=False)), "error"
    ),
    "torque 12 % off, losses below zero, and allowed to be": (
        "losses_negative", decided(motor_and_generator(-0.12, brakes=False)), "warning",
        replace(MOTOR, parameters={"shaft_power_gain": ParameterOverride(sd=0.05)})
    ),
    "no unit in doubt where the torque is allowed to be off": (
        "unit_suspected", motor_and_generator(-0.05, brakes=False), None,
        replace(MOTOR, parameters={"shaft_power_gain": ParameterOverride(sd=0.05)})
    ),
    "torque 5 % off, and allowed to be": (
        "losses_below_copper", decided(motor_and_generator(-0.05, brakes=False)), "warning",
        replace(MOTOR, parameters={"shaft_power_gain": ParameterOverride(sd=0.04)})
    ),
    "map of losses": (
        "shaft_power_disagrees", motor_and_generator(0.03), None, replace(MOTOR, losses="map")
    ),
    "clamp that reads half": (
        "unit_suspected",
        as_columns(changed(TURNING, phase_current_A=0.5 * TURNING["phase_current_A"])), "warning"
    ),
    "resistance of a star beside the current of a delta": (
        "unit_suspected", as_columns(TURNING), "warning",
        replace(MOTOR, phase_resistance_ohm=0.0062 / 3.0)
    ),
    "copper loss beside some of iron": ("unit_suspected", as_columns(TURNING), None),
    "power of two phases of three": ("unit_suspected", TWO_PHASES, "error"),
    "losses of two phases of three, told by that": ("losses_negative", TWO_PHASES, None),
    "torque that reads nothing": (
        "load_stuck", of_balance(TURNING, 8.0 * TURNING["losses_W"], 0.0 * TURNING.time_s),
        "warning"
    ),
    "housing and ambient exchanged": (
        "ambient_implausible",
        changed(
            SMOOTH, housing_degC=SMOOTH["ambient_degC"],
            ambient_degC=22.0 + 0.7 * (SMOOTH["winding_degC"] - 22.0),
        ),
        "error"
    ),
    "wires of a thermocouple exchanged": ("ambient_implausible", MIRRORED, "error"),
    "sensor whose wires are exchanged is not off": ("sensor_detached", MIRRORED, None),
    "settled": ("too_short", heat_run(currents=(100.0,), minutes=170.0, step_s=1.0), None),
}.items()}  # fmt: skip
