"""Clocks out of all proportion, powers that do not add up, windings in another scale.

On the machines of `bench_machines`, with an inverter before them where the record has DC power, and
on machines that nobody chose: none is asked about when all is right, most when a unit is wrong.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from bench_machines import (
    LARGE,
    MACHINES,
    SERVO,
    bench_record,
    cooling_record,
    drawn_machine,
    drawn_record,
)
from test_units_by_physics import (
    CASES,
    DRIVE,
    FIVE,
    SHAFT,
    as_read,
    asked,
    checked,
    from_load_on,
    made,
    motor_of,
    supposed,
)  # fmt: skip

from heatrun.record.record import Record

AIR = [m for m in MACHINES if m.sink == "ambient"]


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
    columns = from_load_on(made(machine, "one level"))
    part = columns["time_s"] < machine.minutes * 6.0
    columns = {name: values[part] for name, values in columns.items()}
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


def started_hot(machine, at_degC, duty):
    """A record of a winding that starts hot, over a stator as hot."""
    columns = dict(bench_record(machine, duty))
    tau = 0.25 * machine.minutes * 60.0
    excess = (at_degC - columns["winding_degC"][0]) * np.exp(-columns["time_s"] / tau)
    return {**columns, "winding_degC": np.round(columns["winding_degC"] + excess, 1)}


@pytest.mark.parametrize("machine", AIR, ids=lambda m: m.name)
def test_a_hot_start_is_no_fahrenheit_where_the_winding_cools_again(machine):
    # 72 degC is 22 degC in Fahrenheit, which is the ambient here
    columns = from_load_on(started_hot(machine, 71.6, "load and cool-down"))
    for record in (columns, cooling_record(machine)):
        assert not checked(as_read(record), motor_of(machine), "units_temperature")


def test_losses_that_are_no_balance_are_not_held_against_the_shaft():
    record = as_read(made(SERVO, "steps"), only=SHAFT, factors={"losses_W": 1e-3})
    bare = Record("run", record.channels, mapping=record.mapping)
    motor = replace(motor_of(SERVO), losses="map")
    assert not any("shaft's power" in f.message for f in asked(bare, motor))


NUMBERS = range(12)

WRONG = {
    "speed in krpm": DRIVE, "speed in rev/s": DRIVE, "speed in rad/s": DRIVE,
    "torque in kNm": DRIVE, "losses in kW": SHAFT, "milliseconds": FIVE, "microseconds": FIVE,
}  # fmt: skip


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


@pytest.mark.parametrize("case", list(WRONG))
def test_a_wrong_unit_is_named_on_most_machines(case):
    factors, name, _ = CASES[case]
    found = [
        asked(as_read(recorded(n), only=WRONG[case], factors=factors), motor_of(drawn_machine(n)))
        for n in NUMBERS
    ]
    named = sum(any(f"factor_{name}" in supposed(one) for one in each) for each in found)
    # A poor machine behind a poor inverter hides a speed in rad/s; nothing is asserted of each.
    assert named >= 0.8 * len(found), [[supposed(f) for f in each] for each in found]
