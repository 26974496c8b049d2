"""Records of very different machines, right and in a wrong unit: what is asked, and what cannot be.

The table says for each wrong unit what a record of five channels shows, and what one with torque,
speed and electrical power shows. What is invisible is so in principle, as stated beside it. Bundled
records, and measured ones where they are at hand, are not asked about.
"""

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from bench_machines import (
    DUTIES,
    MACHINES,
    SERVO,
    STANDARD,
    TRACTION,
    Machine,
    bench_record,
    cooling_record,
    in_turn,
    outrunner,
)
from heat_runs import checked

from heatrun import checks
from heatrun.checks.which_unit import unit_suspected
from heatrun.motor.file import load_motor
from heatrun.readers.align import join
from heatrun.readers.read import read_record
from heatrun.record.derive import derive
from heatrun.record.motor import Motor
from heatrun.record.record import ColumnReading, Finding, Record, UnitSource

FIVE = ("time_s", "phase_current_A", "losses_W", "ambient_degC", "coolant_degC", "winding_degC")
WHOLE = (
    "time_s", "phase_current_A", "electrical_power_W", "speed_rpm", "torque_Nm", "ambient_degC",
    "coolant_degC", "winding_degC",
)  # fmt: skip
SHAFT = (*FIVE, "speed_rpm", "torque_Nm")
DRIVE = (*SHAFT, "dc_power_W")
UNITS = {
    "time_s": "s", "phase_current_A": "A_rms", "losses_W": "W", "electrical_power_W": "W",
    "speed_rpm": "rpm", "torque_Nm": "Nm",
}  # fmt: skip


@cache
def made(machine: Machine, duty: str) -> dict[str, np.ndarray]:
    """A record with DC power too; the inverter takes 4 % of it and a share of the copper loss."""
    columns = bench_record(machine, duty)
    copper = 3.0 * machine.resistance * columns["phase_current_A"] ** 2
    return {**columns, "dc_power_W": columns["electrical_power_W"] / 0.96 + 0.2 * copper}


def motor_of(machine: Machine, *, is_resistance_known: bool = True) -> Motor:
    resistance = machine.resistance if is_resistance_known else None
    return Motor(machine.name, sink=machine.sink, phase_resistance_ohm=resistance)


def as_read(
    columns: dict[str, np.ndarray],
    *,
    unit_from: UnitSource = "assumed",
    is_decided: bool = False,
    only: tuple[str, ...] = FIVE,
    factors: Mapping[str, float] | None = None,
) -> Record:
    """A record as the reader leaves it, columns read as if they were in their canonical units."""
    kept = {k: v * (factors or {}).get(k, 1.0) for k, v in columns.items() if k in only}
    mapping = tuple(
        ColumnReading(name, f"column of {name}", UNITS.get(name, "degC"), unit_from, "t", "a.csv")
        for name in kept
    )
    decided = frozenset(kept if is_decided else ())
    return Record("run", derive(kept)[0], mapping=mapping, decided=decided)


def asked(record: Record, motor: Motor) -> list[Finding]:
    with np.errstate(all="ignore"):  # as `check_record` calls its checks
        return list(unit_suspected(record, motor))


def supposed(finding: Finding) -> list[str]:
    return [name for name in finding.values if name.startswith("factor_")]


@pytest.mark.parametrize("machine", MACHINES, ids=lambda m: m.name)
@pytest.mark.parametrize("duty", list(DUTIES))
def test_a_clean_record_of_any_machine_is_not_asked_about(machine, duty):
    columns = made(machine, duty)
    for only in (FIVE, WHOLE, SHAFT, DRIVE):
        for is_known in (True, False):
            motor = motor_of(machine, is_resistance_known=is_known)
            assert asked(as_read(columns, only=only), motor) == []


@pytest.mark.parametrize("machine", MACHINES, ids=lambda m: m.name)
def test_cooling_without_current_and_a_short_test_are_not_asked_about(machine):
    motor = motor_of(machine)
    assert asked(as_read(cooling_record(machine)), motor) == []
    # a thirtieth of the usual length shows the winding alone, which is as fast as a wrong clock
    quick = replace(machine, step_s=machine.step_s / 10.0, minutes=machine.minutes / 30.0)
    for duty in ("one level", "load and cool-down"):
        assert asked(as_read(bench_record(quick, duty)), motor) == []


@pytest.mark.parametrize("machine", MACHINES, ids=lambda m: m.name)
def test_a_real_fault_is_not_taken_for_a_unit(machine):
    columns, motor = made(machine, "steps"), motor_of(machine)
    time_s, winding = columns["time_s"], columns["winding_degC"]
    later = time_s >= 0.5 * time_s[-1]
    # once off, the sensor takes the air's temperature within seconds
    fall = np.exp(-np.maximum(time_s - time_s[later][0], 0.0) / 4.0)
    first = winding[later][0]
    off = np.where(later, machine.sink_degC + (first - machine.sink_degC) * fall, winding)
    faults = {
        "came off": {"winding_degC": off},
        "broken wire": {"winding_degC": np.where(time_s > 0.97 * time_s[-1], 1372.0, winding)},
        "signs exchanged": {"losses_W": np.where(later, -1.0, 1.0) * columns["losses_W"]},
    }
    for name, changed in faults.items():
        assert asked(as_read({**columns, **changed}), motor) == [], name


# wrong unit: factors on what is read, its name, and by the columns the severity at least
CASES: dict[str, tuple[dict[str, float], str, dict[tuple[str, ...], str]]] = {
    "minutes": ({"time_s": 1.0 / 60.0}, "time_s_min", {FIVE: "error", WHOLE: "error"}),
    "hours": ({"time_s": 1.0 / 3600.0}, "time_s_h", {FIVE: "error", WHOLE: "error"}),
    "milliseconds": ({"time_s": 1e3}, "time_s_ms", {FIVE: "error", WHOLE: "error"}),
    "microseconds": ({"time_s": 1e6}, "time_s_us", {FIVE: "error"}),
    "nanoseconds": ({"time_s": 1e9}, "time_s_ns", {FIVE: "error"}),
    "losses in kW": ({"losses_W": 1e-3}, "losses_W_kW", {FIVE: "error", SHAFT: "error"}),
    # little copper loss is what a machine without load has: odd, and no more
    "losses in mW": ({"losses_W": 1e3}, "losses_W_mW", {FIVE: "warning"}),
    "current in mA": (
        {"phase_current_A": 1e3}, "phase_current_A_mA_rms", {FIVE: "error", WHOLE: "error"}
    ),
    "current in kA": (
        {"phase_current_A": 1e-3}, "phase_current_A_kA_rms", {FIVE: "warning", WHOLE: "warning"}
    ),
    "losses and current in kW and kA": (
        {"losses_W": 1e-3, "phase_current_A": 1e-3},
        "losses_W_and_phase_current_A_kW_and_kA_rms", {SHAFT: "error"},
    ),
    "losses and current in mW and mA": (
        {"losses_W": 1e3, "phase_current_A": 1e3},
        "losses_W_and_phase_current_A_mW_and_mA_rms", {SHAFT: "error"},
    ),
    "power in kW": ({"electrical_power_W": 1e-3}, "electrical_power_W_kW", {WHOLE: "error"}),
    "torque in mNm": ({"torque_Nm": 1e3}, "torque_Nm_mNm", {WHOLE: "error", SHAFT: "error"}),
    "torque in kNm": ({"torque_Nm": 1e-3}, "torque_Nm_kNm", {DRIVE: "warning"}),
    # an efficiency of 10 % exists
    "speed in rad/s": (
        {"speed_rpm": np.pi / 30.0}, "speed_rpm_rad/s", {WHOLE: "warning", DRIVE: "warning"}
    ),
    "speed in krpm": ({"speed_rpm": 1e-3}, "speed_rpm_krpm", {WHOLE: "warning", DRIVE: "warning"}),
    "speed in rev/s": ({"speed_rpm": 1.0 / 60.0}, "speed_rpm_rev/s", {DRIVE: "warning"}),
}  # fmt: skip
SAID = {"microseconds": "years", "nanoseconds": "years", "losses in mW": "copper loss is only"}


@pytest.mark.parametrize(("case", "machine"), in_turn(CASES, MACHINES))
def test_a_wrong_unit_is_named(case, machine):
    factors, name, severities = CASES[case]
    for only, severity in severities.items():
        record = as_read(made(machine, "steps"), only=only, factors=factors)
        (finding,) = asked(record, motor_of(machine))
        # a factor is named once, or beside others that the record cannot tell from it
        assert f"factor_{name}" in supposed(finding), finding
        assert len(supposed(finding)) <= 3
        assert finding.severity in {"warning": ("warning", "error"), "error": ("error",)}[severity]
        assert "into [columns]" in finding.remedy
        for channel in factors:
            assert f'{channel} = "column of {channel} [' in finding.remedy
        assert SAID.get(case, "DC power" if only is DRIVE else "") in finding.message


def from_load_on(columns: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    is_loaded = columns["losses_W"] > 0.1 * np.max(columns["losses_W"])
    first = max(0, int(np.argmax(is_loaded)) - 1)
    kept = {name: values[first:] for name, values in columns.items()}
    return {**kept, "time_s": kept["time_s"] - kept["time_s"][0]}


# by channel factor and offset of what is read; the first is told, with its severity; hall [K]
KELVIN, FAHRENHEIT = (1.0, 273.15), (1.8, 32.0)
TEMPERATURES = {
    "all in kelvin": ({"ambient_degC": KELVIN, "winding_degC": KELVIN}, "[K]", "error", 0.0),
    "winding in kelvin": ({"winding_degC": KELVIN}, "[K]", "error", 0.0),
    "ambient in kelvin": ({"ambient_degC": KELVIN}, "[K]", "error", 0.0),
    "all in Fahrenheit": (
        {"ambient_degC": FAHRENHEIT, "winding_degC": FAHRENHEIT}, "[degF]", "error", 0.0
    ),
    "ambient in Fahrenheit": ({"ambient_degC": FAHRENHEIT}, "[degF]", "error", 0.0),
    "ambient in Fahrenheit, 1.5 K off": ({"ambient_degC": (1.8, 34.7)}, "[degF]", "error", 0.0),
    # a winding of 72 degC in air of 22 degC is a hot start as well
    "winding in Fahrenheit": ({"winding_degC": FAHRENHEIT}, "[degF]", "warning", 0.0),
    "winding in Fahrenheit, 2 K off": ({"winding_degC": (1.8, 35.6)}, "[degF]", "warning", 0.0),
    "winding in Fahrenheit, -2 K off": ({"winding_degC": (1.8, 28.4)}, "[degF]", "warning", 0.0),
    "winding in Fahrenheit, cold": ({"winding_degC": FAHRENHEIT}, "[degF]", "warning", -20.0),
    "tenths": ({"winding_degC": (10.0, 0.0)}, "by 10 before", "error", 0.0),
    # of a winding at 2 degC the hundredths are near the sink as well
    "tenths, cold": ({"winding_degC": (10.0, 0.0)}, "by 10 before", "error", -20.0),
    "hundredths, cold": ({"winding_degC": (100.0, 0.0)}, "by 100 before", "error", -15.0),
    "thousandths": ({"winding_degC": (1000.0, 0.0)}, "by 1000 before", "error", 0.0),
}  # fmt: skip


@pytest.mark.parametrize(
    ("case", "machine"), in_turn(TEMPERATURES, [m for m in MACHINES if m.sink == "ambient"])
)
def test_a_wrong_unit_of_temperature_is_named(case, machine):
    changes, said, severity, hall_K = TEMPERATURES[case]
    motor, channel = motor_of(machine), next(iter(changes))
    columns = dict(made(machine, "steps"))
    # the copper loss stays as it is
    columns |= {n: values + hall_K for n, values in columns.items() if n.endswith("degC")}
    columns |= {n: factor * columns[n] + offset for n, (factor, offset) in changes.items()}
    for read in (columns, from_load_on(columns)):
        (named,) = (
            one for one in checked(as_read(read), motor, "units_temperature")
            if channel in one.where
        )  # fmt: skip
        assert named.severity == severity
        assert f'{channel} = "column of {channel} [' in named.remedy
        assert said in named.remedy
        assert not checked(as_read(read), motor, "unit_suspected")
    # what the motor file decides is a warning, but for kelvin
    (named, *_) = checked(as_read(columns, is_decided=True), motor, "units_temperature")
    assert named.severity == (severity if "K" in said else "warning")


INVISIBLE = {
    # Without a resistance no relation ties the current to anything: a network with another Rs0
    # fits as well.
    "current in mA, no resistance": (STANDARD, False, {"phase_current_A": 1e3}),
    # Water takes as much heat from a small body as air from a body thirty times as large.
    "kW of a water-cooled machine, no resistance": (TRACTION, False, {"losses_W": 1e-3}),
    # Ten times as slow is what another cooling does: a sample number at 10 Hz read as seconds.
    "tenths of seconds": (TRACTION, True, {"time_s": 10.0}),
    # Half of the losses are copper's: as amplitudes they are all of it, which is not impossible.
    "amplitude where copper is half": (STANDARD, True, {"phase_current_A": 2.0**0.5}),
}


@pytest.mark.parametrize(
    ("grams", "seconds"),
    [(5.0, 25.0), pytest.param(50.0, 25.0, marks=pytest.mark.slow), (500.0, 60.0)],
)
def test_a_small_motor_in_the_wash_of_its_propeller_is_judged_by_its_own_scale(grams, seconds):
    machine = outrunner(grams, seconds)
    columns, motor = bench_record(machine, "load and cool-down"), motor_of(machine)
    for only, name in ((FIVE, "losses_W"), (WHOLE, "electrical_power_W")):
        assert asked(as_read(columns, only=only, unit_from="stated"), motor) == []
        for factor, unit in ((1e-3, "kW"), (1e3, "mW")):
            record = as_read(columns, only=only, unit_from="stated", factors={name: factor})
            (finding,) = asked(record, motor)
            assert finding.severity == "error"
            assert f"factor_{name}_{unit}" in supposed(finding), finding


@pytest.mark.parametrize("case", list(INVISIBLE))
def test_what_a_record_cannot_tell_is_not_asked(case):
    machine, is_known, factors = INVISIBLE[case]
    motor = motor_of(machine, is_resistance_known=is_known)
    assert asked(as_read(made(machine, "steps"), factors=factors), motor) == []


def test_an_amplitude_shows_where_it_exceeds_the_losses():
    columns = made(SERVO, "on and off")
    (finding,) = asked(as_read(columns, factors={"phase_current_A": 2.0**0.5}), motor_of(SERVO))
    assert supposed(finding)[0] == "factor_phase_current_A_A_peak"
    assert "between two terminals" in finding.message
    assert finding.severity == "error"


def test_both_powers_in_kilowatts_are_named_together():
    columns = made(STANDARD, "steps")
    both = as_read(
        columns, only=(*WHOLE, "losses_W"), factors={"losses_W": 1e-3, "electrical_power_W": 1e-3}
    )
    (finding,) = asked(both, motor_of(STANDARD))
    assert supposed(finding) == ["factor_losses_W_and_electrical_power_W_kW"]
    assert 'losses_W = "column of losses_W [kW]"' in finding.remedy
    assert 'electrical_power_W = "column of electrical_power_W [kW]"' in finding.remedy


@pytest.mark.parametrize(
    ("unit_from", "is_decided", "severity"),
    [
        ("assumed", False, "error"),
        ("name", False, "error"),
        ("stated", False, "error"),
        ("stated", True, "warning"),
    ],
)
def test_who_said_the_unit_decides_how_it_is_asked(unit_from, is_decided, severity):
    record = as_read(
        made(TRACTION, "steps"),
        unit_from=unit_from, is_decided=is_decided, factors={"time_s": 1.0 / 60.0},
    )  # fmt: skip
    (finding,) = asked(record, motor_of(TRACTION))
    assert finding.severity == severity
    assert 'time_s = "column of time_s [min]"' in finding.remedy
    is_said = {"assumed": "no unit given", "name": "by the name", "stated": "states"}
    assert is_said[unit_from] in finding.message


def test_another_kind_of_cooling_is_a_warning_where_a_name_gives_the_unit():
    # water-cooled, but the motor file gives the air as its sink
    columns = {k: v for k, v in made(TRACTION, "on and off").items() if k != "coolant_degC"}
    columns["ambient_degC"] = made(TRACTION, "on and off")["coolant_degC"]
    motor = replace(motor_of(TRACTION), sink="ambient")
    record = as_read(columns, unit_from="name", factors={"time_s": 0.3})
    (finding,) = asked(record, motor)
    assert finding.severity == "warning"
    assert 'sink = "coolant"' in finding.remedy


@pytest.mark.parametrize(("machine", "said"), [(STANDARD, "where air"), (TRACTION, "a liquid")])
def test_watts_under_kilowatts_are_an_error_whatever_the_heading_says(machine, said):
    record = as_read(made(machine, "steps"), unit_from="stated", factors={"losses_W": 1e3})
    (finding,) = asked(record, motor_of(machine))
    assert finding.severity == "error"
    # alone, little copper loss may be that of a machine without load
    assert said in finding.message
    assert "copper loss is only" in finding.message
    assert "e+0" not in finding.message  # as a bench writes numbers
    decided = as_read(
        made(machine, "steps"), unit_from="stated", is_decided=True, factors={"losses_W": 1e3}
    )
    (finding,) = asked(decided, motor_of(machine))
    assert finding.severity == "warning"


def test_minutes_no_longer_look_like_a_sensor_that_came_off():
    record = as_read(made(TRACTION, "load and cool-down"), factors={"time_s": 1.0 / 60.0})
    errors = {
        f.id for f in checks.check_record(record, motor_of(TRACTION)) if f.severity == "error"
    }
    assert errors == {"unit_suspected"}


def test_a_sample_number_is_thought_of():
    columns = made(STANDARD, "steps")
    record = as_read({**columns, "time_s": np.arange(columns["time_s"].size) * 1.0})
    motor = motor_of(STANDARD)
    assert asked(record, motor) == []
    # every tenth second at 1 kHz: a count of 1000 per second
    counted = as_read({**columns, "time_s": 1000.0 * np.arange(columns["time_s"].size)})
    (finding,) = asked(counted, motor)
    assert 'time_s = "rate 10 Hz"' in finding.remedy


def test_wheel_and_shaft_are_compared():
    columns = dict(made(TRACTION, "steps"))
    motor = replace(motor_of(TRACTION), gear_ratio=9.1, wheel_radius_m=0.29, rated_speed_rpm=5500)
    columns["vehicle_speed_km_per_h"] = columns["speed_rpm"] / 9.1 * np.pi / 30.0 * 0.29 * 3.6
    only = (*FIVE, "speed_rpm", "vehicle_speed_km_per_h")
    assert asked(as_read(columns, only=only), motor) == []
    (finding,) = asked(as_read(columns, only=only, factors={"speed_rpm": np.pi / 30.0}), motor)
    assert supposed(finding) == ["factor_speed_rpm_rad/s"]


def test_a_motor_in_the_wash_of_its_propeller_has_its_seconds():
    drone = Machine(
        "drone 3 kW", 120.0, 280.0, 60.0, 0.03, 0.3, 0.10, 0.03, 55.0, 60.0, 6000.0, 5.0,
        step_s=0.5, minutes=40.0,
    )  # fmt: skip
    columns = made(drone, "steps")
    load = columns["torque_Nm"] / drone.torque
    propeller = {**columns, "speed_rpm": drone.speed * np.sqrt(load)}
    shaft = ("time_s", "phase_current_A", "losses_W", "speed_rpm", "torque_Nm", *FIVE[3:])
    for unit_from in ("stated", "name"):
        for taken in (columns, propeller):
            record = as_read(taken, only=shaft, unit_from=unit_from)
            is_asked = bool(asked(record, motor_of(drone)))
            assert is_asked is (taken is columns), unit_from


DATA = Path(__file__).parents[2] / "data" / "synthetic"
SHARED = Path(__file__).resolve().parents[3] / "shared" / "bench"
BUNDLED = sorted(p.relative_to(DATA) for p in DATA.rglob("*.csv.gz"))
MEASURED = pytest.mark.skipif(not SHARED.is_dir(), reason="the measured records are not here")


def sentences(record, motor):
    return [finding.sentence() for finding in checked(record, motor, "unit_suspected")]


@pytest.mark.parametrize("name", BUNDLED, ids=str)
def test_a_bundled_record_is_not_asked_about(name):
    path = DATA / name
    motor = load_motor(path.with_name("motor.toml"))
    assert sentences(read_record(path, motor), motor) == []


@MEASURED
@pytest.mark.parametrize("sink", ["coolant", "ambient"])
@pytest.mark.parametrize("resistance", [None, 0.0125])
def test_a_measured_traction_motor_is_not_asked_about(sink, resistance):
    motor = Motor("traction", sink=sink, phase_resistance_ohm=resistance)
    (path,) = SHARED.glob("paderborn*")
    assert sentences(read_record(path, motor), motor) == []


@MEASURED
@pytest.mark.parametrize("run", ["Run3", "Run13"])
def test_a_measured_small_motor_is_not_asked_about(run):
    (folder,) = (SHARED / "tass").glob(f"{run}-*")
    (thermometer,), (drive,) = folder.glob("DAQ*.csv"), folder.glob("Export*.csv")
    # the power from the link stands for the losses: the propeller was off
    columns = {"time_s": "rate 10 Hz", "losses_W": "Power [W]"}
    motor = Motor("small", columns=columns)
    joined, _ = join(read_record(thermometer, Motor("small")), read_record(drive, motor))
    assert sentences(joined, motor) == []
