"""Clocks out of all proportion, powers that do not add up, windings in another scale.

On the machines of `bench_machines`, with an inverter before them where the record has DC power, and
on machines that nobody chose: none is asked about when all is right, most when a unit is wrong.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from bench_machines import (
    LARGE,
    MACHINES,
    SERVO,
    STANDARD,
    bench_record,
    cooling_record,
    drawn_machine,
    drawn_record,
    in_turn,
)
from test_units_by_physics import (
    DRIVE,
    FIVE,
    SHAFT,
    as_read,
    asked,
    checked,
    made,
    motor_of,
    supposed,
)  # fmt: skip

from heatrun.record.record import Record

AIR = [m for m in MACHINES if m.sink == "ambient"]


def start_of(columns, seconds):
    """The first seconds of a record under load."""
    first = int(np.argmax(columns["losses_W"] > 0.1 * np.max(columns["losses_W"])))
    part = columns["time_s"] < columns["time_s"][first] + seconds
    part[: max(0, first - 1)] = False
    kept = {name: values[part] for name, values in columns.items()}
    return {**kept, "time_s": kept["time_s"] - kept["time_s"][0]}


@pytest.mark.parametrize("machine", MACHINES, ids=lambda m: m.name)
def test_a_poor_inverter_and_a_locked_rotor_are_not_asked_about(machine):
    columns = dict(made(machine, "steps"))
    columns["dc_power_W"] = columns["electrical_power_W"] / 0.6
    assert asked(as_read(columns, only=DRIVE), motor_of(machine)) == []
    columns = dict(made(machine, "standstill"))
    columns["dc_power_W"] = 4.0 * columns["electrical_power_W"]
    columns["torque_Nm"] = columns["phase_current_A"] / machine.current * machine.torque
    assert asked(as_read(columns, only=DRIVE), motor_of(machine)) == []


@pytest.mark.parametrize("machine", MACHINES, ids=lambda m: m.name)
def test_a_start_in_milliseconds_is_named_before_anything_has_settled(machine):
    # a tenth of the slow time constant under load, the winding is still rising
    columns = start_of(made(machine, "one level"), machine.minutes * 6.0)
    assert asked(as_read(columns), motor_of(machine)) == []
    found = asked(as_read(columns, factors={"time_s": 1e3}), motor_of(machine))
    assert [supposed(f)[0] for f in found] == ["factor_time_s_ms"]
    assert found[0].severity == "error"


@pytest.mark.parametrize(
    ("unit_from", "is_named"), [("assumed", True), ("name", True), ("stated", False)]
)
def test_a_creeping_clock_names_milliseconds_unless_its_unit_is_stated(unit_from, is_named):
    # half an hour a sample: a slow logger as well as one of two seconds in milliseconds
    columns = {name: values[:: len(values) // 300] for name, values in made(LARGE, "steps").items()}
    columns["time_s"] = np.arange(columns["time_s"].size) * 1800.0
    (told,) = checked(as_read(columns, unit_from=unit_from), motor_of(LARGE), "sampling")
    assert told.severity == "warning"
    assert ('time_s = "column of time_s [ms]"' in told.message) is is_named


def in_hall(columns, hall_K):
    """The same in a hall or chamber that much warmer; the copper loss stays as it is."""
    temperatures = {n: v + hall_K for n, v in columns.items() if n.endswith("degC")}
    return {**columns, **temperatures}


def started_hot(machine, at_degC, duty):
    """A record of a winding that starts hot, over a stator as hot."""
    columns = dict(bench_record(machine, duty))
    tau = 0.25 * machine.minutes * 60.0
    excess = (at_degC - columns["winding_degC"][0]) * np.exp(-columns["time_s"] / tau)
    return {**columns, "winding_degC": np.round(columns["winding_degC"] + excess, 1)}


@pytest.mark.parametrize(
    ("sensors_K", "hall_K", "machine"),
    in_turn([(-2.0, 0.0), (0.0, 0.0), (2.0, 0.0), (0.0, -20.0)], AIR),
)
def test_a_winding_in_fahrenheit_is_named_where_the_load_is_on_from_the_start(
    sensors_K, hall_K, machine
):
    columns = in_hall(start_of(made(machine, "steps"), 1e9), hall_K)
    true = columns["winding_degC"] + sensors_K
    record = as_read({**columns, "winding_degC": 1.8 * true + 32.0})
    found = checked(record, motor_of(machine), "units_temperature")
    assert [f.severity for f in found] == ["warning"]
    assert 'winding_degC = "column of winding_degC [degF]"' in found[0].remedy


@pytest.mark.parametrize("machine", AIR, ids=lambda m: m.name)
def test_a_hot_start_is_no_fahrenheit_where_the_winding_cools_again(machine):
    # 72 degC is 22 degC in Fahrenheit, which is the ambient here
    columns = start_of(started_hot(machine, 71.6, "load and cool-down"), 1e9)
    for record in (columns, cooling_record(machine)):
        assert not checked(as_read(record), motor_of(machine), "units_temperature")


@pytest.mark.parametrize(
    ("scale", "is_decided", "severity", "hall_K", "machine"),
    in_turn(
        [
            (scale, *said)
            for scale in (10.0, 100.0, 1000.0)
            for said in [(False, "error", 0.0), (True, "warning", 0.0), (False, "error", -15.0)]
        ],
        AIR,
    ),
)
def test_a_winding_in_tenths_of_degrees_is_named(scale, is_decided, severity, hall_K, machine):
    columns = in_hall(made(machine, "steps"), hall_K)
    columns["winding_degC"] = scale * columns["winding_degC"]
    record = as_read(columns, unit_from="stated", is_decided=is_decided)
    told = checked(record, motor_of(machine), "units_temperature")
    assert [f.severity for f in told] == [severity]
    assert ("only a warning" in told[0].remedy) == (severity == "error")
    assert f"Divide the column by {scale:.0f}" in told[0].remedy


def test_ambient_in_fahrenheit_is_named_where_the_load_is_on_from_the_start():
    columns = start_of(made(STANDARD, "steps"), 1e9)
    columns["ambient_degC"] = 1.8 * (columns["ambient_degC"] + 1.5) + 32.0
    told = checked(as_read(columns), motor_of(STANDARD), "units_temperature")
    assert 'ambient_degC = "column of ambient_degC [degF]"' in told[0].remedy


def test_losses_that_are_no_balance_are_not_held_against_the_shaft():
    record = as_read(made(SERVO, "steps"), only=SHAFT, factors={"losses_W": 1e-3})
    bare = Record("run", record.channels, mapping=record.mapping)
    motor = replace(motor_of(SERVO), losses="map")
    assert not any("shaft's power" in f.message for f in asked(bare, motor))


NUMBERS = range(12)

WRONG = {
    "factor_speed_rpm_krpm": (DRIVE, {"speed_rpm": 1e-3}),
    "factor_speed_rpm_rev/s": (DRIVE, {"speed_rpm": 1.0 / 60.0}),
    "factor_speed_rpm_rad/s": (DRIVE, {"speed_rpm": np.pi / 30.0}),
    "factor_torque_Nm_kNm": (DRIVE, {"torque_Nm": 1e-3}),
    "factor_losses_W_kW": (SHAFT, {"losses_W": 1e-3}),
    "factor_time_s_ms": (FIVE, {"time_s": 1e3}),
    "factor_time_s_us": (FIVE, {"time_s": 1e6}),
}


@cache
def recorded(number, *, slow=False):
    return drawn_record(drawn_machine(number), number, slow=slow)


@pytest.mark.parametrize("number", NUMBERS)
@pytest.mark.parametrize("slow", [False, True])
def test_a_right_record_is_not_asked_about(number, slow):
    machine = drawn_machine(number)
    columns = recorded(number, slow=slow)
    for only in (FIVE, SHAFT, DRIVE):
        assert asked(as_read(columns, only=only), motor_of(machine)) == []


@pytest.mark.parametrize("name", list(WRONG))
def test_a_wrong_unit_is_named_on_most_machines(name):
    only, factors = WRONG[name]
    found = [
        asked(as_read(recorded(n), only=only, factors=factors), motor_of(drawn_machine(n)))
        for n in NUMBERS
    ]
    named = sum(any(name in supposed(finding) for finding in each) for each in found)
    # A poor machine behind a poor inverter hides a speed in rad/s; nothing is asserted of each.
    assert named >= 0.8 * len(found), [[supposed(f) for f in each] for each in found]
