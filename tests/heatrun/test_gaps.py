"""A restart of the logger keeps both sides: bridged where the load is known, else two parts."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from heat_runs import MOTOR, at, edited, heat_run, named

from heatrun.checks import check_record
from heatrun.errors import InputError
from heatrun.motor.file import parse_motor
from heatrun.readers.joined import parts_of
from heatrun.record.motor import PartsOfTest
from heatrun.record.reduction import reduce
from heatrun.runs.motor_text import motor_text

FROM_S, TO_S = 1500.0, 2220.0
NEVER_OFF = heat_run(currents=(120.0,) * 5, minutes=60.0, step_s=1.0)
STOPPED = heat_run(currents=(120.0, 120.0, 0.0, 120.0, 120.0), minutes=60.0, step_s=1.0)
OTHER_LOAD = heat_run(currents=(140.0, 140.0, 140.0, 60.0, 60.0), minutes=60.0, step_s=1.0)
COOLS = heat_run(currents=(140.0, 140.0, 0.0, 0.0, 0.0), minutes=60.0, step_s=1.0)


def restarted(record, from_s=FROM_S, to_s=TO_S):
    """The record without what lies between two times [s]."""
    return at(record, (record.time_s <= from_s) | (record.time_s >= to_s))


def saying(load):
    text = f'[motor]\nname = "M"\n[tests.run.gap]\nload = "{load}"\n'
    return replace(MOTOR, tests=parse_motor(text.encode(), "motor.toml").tests)


@pytest.mark.parametrize(
    ("record", "load", "severity", "num_parts", "level"),
    [
        (NEVER_OFF, None, "warning", 1, 1.0),  # it goes on as it was
        (COOLS, None, "warning", 1, 0.0),
        (STOPPED, None, "warning", 2, None),  # one load on both sides, a colder winding
        (OTHER_LOAD, None, "warning", 2, None),
        (STOPPED, "zero", "note", 1, 0.0),
        (OTHER_LOAD, "held", "note", 1, 1.0),
        (NEVER_OFF, "unknown", "note", 2, None),
    ],
)
def test_both_sides_of_a_gap_are_kept(record, load, severity, num_parts, level):
    whole = restarted(record)
    motor = saying(load) if load else MOTOR
    parts = parts_of(whole, motor, at_gaps=True)
    assert len(parts) == num_parts
    kept = np.concatenate([one.time_s[np.isfinite(one["winding_degC"])] for one in parts])
    assert np.array_equal(kept, whole.time_s)
    found = [f for one in parts for f in check_record(one, motor)]
    (gap,) = [f for f in found if f.id == "time_gap"]
    assert gap.severity == severity
    assert (gap.values["from_s"], gap.values["to_s"]) == (FROM_S, TO_S)
    assert {f.severity for f in found} <= {"note", "warning"}
    assert not {"nan_block", "cut_while_warm", "start_not_in_equilibrium"} & {f.id for f in found}
    if level is not None:
        before = whole.time_s[whole.time_s <= FROM_S][-60:]
        held = whole["losses_W"][np.isin(whole.time_s, before)].mean()
        test = reduce(parts[0], motor)
        middle = (np.arange(test.inputs.num_time) + 0.5) * float(test.inputs.step)
        inside = (middle > FROM_S + 4.0) & (middle < TO_S - 4.0)
        np.testing.assert_allclose(np.asarray(test.inputs.losses)[inside], level * held, atol=3.0)
        assert test.count[(test.time > FROM_S + 30.0) & (test.time < TO_S - 30.0)].sum() == 0


@pytest.mark.parametrize("record", [NEVER_OFF, STOPPED])
def test_each_line_that_is_offered_answers_the_finding(record):
    whole = restarted(record)
    for part in parts_of(whole, MOTOR, at_gaps=True):
        for finding in named(check_record(part, MOTOR), "time_gap"):
            lines = re.findall(r'\[tests\.run\.gap\] load = "(\w+)"', finding.remedy)
            assert len(lines) == 2
            for load in lines:
                motor = saying(load)
                again = [f for one in parts_of(whole, motor, at_gaps=True)
                         for f in named(check_record(one, motor), "time_gap")]  # fmt: skip
                assert [f.severity for f in again] == ["note"]


def test_a_short_gap_stays_as_it_is_unless_its_load_is_stated():
    whole = restarted(NEVER_OFF, 1500.0, 1560.0)
    (part,) = parts_of(whole, MOTOR, at_gaps=True)
    assert part is whole
    (part,) = parts_of(whole, saying("zero"), at_gaps=True)
    assert part.time_s.size == whole.time_s.size + 2


def test_one_record_is_wanted_where_a_test_is_driven():
    whole = restarted(OTHER_LOAD)
    assert parts_of(whole, MOTOR) == (whole,)
    (part,) = parts_of(whole, saying("held"))
    assert part.masks == ((FROM_S + 1.0, TO_S - 1.0),)


def test_parts_that_are_used_are_bridged_and_masked_too():
    whole = restarted(NEVER_OFF)
    use = parse_motor(
        b'[motor]\nname = "M"\n[tests.run]\nuse_rows = [[301, 2000]]\nmask = [[600, 660]]\n'
        b'gap.load = "held"\n',
        "motor.toml",
    )
    motor = replace(MOTOR, tests=use.tests)
    (part,) = parts_of(whole, motor, at_gaps=True)
    assert (part.time_s[0], part.time_s.size) == (300.0, 1702)
    assert set(part.masks) == {(FROM_S + 1.0, TO_S - 1.0), (600.0, 660.0)}
    assert not named(check_record(part, motor), "nan_block")


def test_a_clock_that_is_wrong_is_no_gap():
    back = edited(NEVER_OFF, "time_s", 2000.0, 4000.0, lambda time_s: time_s - 900.0)
    assert parts_of(back, MOTOR, at_gaps=True) == (back,)


def test_what_is_stated_of_a_gap_goes_with_the_run():
    motor = replace(MOTOR, tests={"run": PartsOfTest(gap_load="zero")})
    assert parse_motor(motor_text(motor), "again").tests == motor.tests


@pytest.mark.parametrize("line", ['gap.load = "off"', 'gap = "held"', "gap = {}", "gap.loads = 1"])
def test_what_is_no_load_of_a_gap_is_refused(line):
    text = f'[motor]\nname = "M"\n[tests.run]\n{line}\n'
    with pytest.raises(InputError, match=r'gap\.load = "held", "zero" or "unknown"'):
        parse_motor(text.encode(), "motor.toml")
