"""Each check keeps silent on a clean heat run, finds its own fault, and advises what mends it."""

import re
import tomllib
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from faults_of_records import FAULTS, VARIANTS, Variant
from heat_runs import CLEAN, MOTOR, SMOOTH, checked, edited, heat_run

from heatrun.checks import CHECKS, check_record
from heatrun.checks.advice import section_of
from heatrun.motor.file import parse_motor
from heatrun.readers.joined import parts_of
from heatrun.record.motor import Motor
from heatrun.record.record import ColumnReading, Record

LINE = re.compile(r"(\[tests\.[^\]]+\]) ((?:use|use_rows|mask) = \[\[.*?\]\])")
CASES = VARIANTS | {id: Variant(id, f.record, f.severity, f.motor) for id, f in FAULTS.items()}


@cache
def told(name):
    """Return what is told of a case under its id; the record is called run."""
    return checked(CASES[name].record, CASES[name].motor, CASES[name].id)


def test_a_winding_that_is_clipped_is_told_once():
    """Readings in steps of 2 °C that flicker about the end of the range; what stands below it, once
    the highest are left out, is its doing.
    """
    time_s = np.arange(0.0, 3600.0, 2.0)
    loaded = (time_s > 60.0) & (time_s < 3000.0)
    winding = stator = 20.0
    course = []
    for heats in loaded:
        course.append(winding)
        to_stator = (winding - stator) / 0.15
        stator += 2.0 * (20.0 * heats + to_stator - (stator - 20.0) / 0.2) / 1500.0
        winding += 2.0 * (250.0 * heats - to_stator) / 250.0
    noise = 0.3 * np.random.default_rng(1).normal(size=time_s.size)
    readings = 2.0 * np.round(0.5 * (np.minimum(course, 85.3) + noise))
    channels = {"time_s": time_s, "winding_degC": readings, "ambient_degC": np.full(1800, 20.0),
                "phase_current_A": 40.8 * loaded, "losses_W": 270.0 * loaded}  # fmt: skip
    found = check_record(Record("clipped", channels), Motor("m", phase_resistance_ohm=0.05))
    (top,) = [one for one in found if one.id in ("saturation", "sensor_stuck")]
    assert top.values["extreme"] == 86.0


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


def test_every_check_has_its_fault():
    assert {check.__name__ for check in CHECKS} == set(FAULTS)


@pytest.mark.parametrize("id", FAULTS)
def test_each_check_finds_its_own_fault(id):
    _, severity, key, (low, high), _ = FAULTS[id]
    found = told(id)
    assert [f.severity for f in found if f.severity == severity], found
    finding = next(f for f in found if f.severity == severity)
    assert finding.test == "run"
    assert "run" in finding.where
    if severity != "note":
        assert finding.remedy.endswith((".", "?"))
    if key:
        assert low <= finding.values[key] <= high
    assert all(np.isfinite(list(finding.values.values())))


@pytest.mark.parametrize("name", VARIANTS)
def test_the_same_fault_in_another_form(name):
    severity = VARIANTS[name].severity
    assert {f.severity for f in told(name)} == ({severity} if severity else set())


def advised(name):
    """Yield the findings of a case that advise a line, with section and line."""
    for finding in told(name):
        for section, line in LINE.findall(finding.remedy):
            if "FROM" not in line:
                yield finding, section, line


def test_the_checks_that_can_advise_a_line_do():
    assert {CASES[name].id for name in CASES if any(advised(name))} >= {
        "nan_block", "time_gap", "time_backwards",
        "sensor_stuck", "sensor_detached", "temperature_jump",
    }  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_the_advised_line_does_away_with_the_finding(name):
    _, record, _, motor = CASES[name]
    for finding, section, line in advised(name):
        text = f'[motor]\nname = "M"\n{section}\n{line}\n'
        said = replace(motor, tests=parse_motor(text.encode(), "motor.toml").tests)
        for part in parts_of(record, said):
            left = checked(part, motor, finding.id)
            before = (finding.values.get("from_s"), finding.where)
            assert all((one.values.get("from_s"), one.where) != before for one in left)
            if finding.severity == "error" and "use" in line:
                assert all(one.severity != "error" for one in left)


def test_a_cooling_is_used_where_losses_are_absent():
    time_s = np.arange(0.0, 3600.0, 1.0)
    warm = 60.0 * (1.0 - np.exp(-time_s / 600.0))
    cool = warm[1800] * np.exp(-(time_s - 1800.0) / 600.0)
    channels = {
        "time_s": time_s,
        "phase_current_A": 0.0 * time_s,
        "losses_W": 0.0 * time_s,
        "ambient_degC": 20.0 + 0.0 * time_s,
        "winding_degC": 20.0 + np.where(time_s < 1800.0, warm, cool),
    }
    (finding,) = checked(Record("t", channels), Motor("M"), "losses_absent")
    section, line = LINE.findall(finding.remedy)[0]
    text = f'[motor]\nname = "M"\n{section}\n{line}\n'
    (part,) = parts_of(Record("t", channels), parse_motor(text.encode(), "motor.toml"))
    begin_s = -600.0 * np.log(np.exp(-3.0) + 5.0 / 60.0)  # from here on it warms by 5 K
    assert part.time_s[0] == pytest.approx(begin_s, abs=15.0)
    assert part.time_s[-1] == time_s[-1]
    assert not checked(part, Motor("M"), "losses_absent")


@pytest.mark.parametrize("watts", [0.0, 0.3, 60.0])
def test_a_cooling_under_what_a_wattmeter_reads_at_zero_tells_time_constants(watts):
    time_s = np.arange(0.0, 3600.0, 5.0)
    losses = watts * np.abs(np.random.default_rng(2).standard_normal(time_s.size))
    rest = 20.0 + 0.25 * watts
    winding = rest + 60.0 * np.exp(-time_s / 800.0) + 20.0 * np.exp(-time_s / 40.0)
    channels = {
        "time_s": time_s, "phase_current_A": 0.02 + 0.0 * time_s, "losses_W": losses,
        "ambient_degC": 20.0 + 0.0 * time_s, "winding_degC": winding,
    }  # fmt: skip
    reading = ColumnReading("losses_W", "P", "W", "name", "canonical name", "")
    record = Record("t", channels, mapping=(reading,))
    findings = {one.id: one for one in check_record(record, MOTOR)}
    assert "losses_of_shaft" not in findings
    found = [findings["no_heating"].values.get(name) for name in ("tau_fast_s", "tau_slow_s")]
    # under a load that matters, it ends at no temperature that is known
    assert found == ([None, None] if watts > 1.0 else pytest.approx([40.0, 800.0], rel=0.05))


@pytest.mark.parametrize("name", ["drive", "a b", 'say "x"', "à\u2028b", "bell\x07", "rubout\x7f"])
def test_the_advised_section_names_the_test(name):
    header = section_of(replace(CLEAN, name=name))
    assert tomllib.loads(header) == {"tests": {name: {}}}


def advice_on_missing(channel: str, *blocks: tuple[float, float], masks=()) -> str:
    record = replace(CLEAN, name="t", masks=masks)
    for begin, end in blocks:
        record = edited(record, channel, begin, end, np.nan)
    (found,) = checked(record, MOTOR, "nan_block")
    assert found.severity == "error"
    return found.remedy


def test_missing_readings_are_left_out_by_a_mask_with_their_times():
    said = advice_on_missing("winding_degC", (600.0, 630.0), (900.0, 940.0))
    assert "[tests.t] mask = [[600.0, 630.0], [900.0, 939.9]] in the motor file" in said
    both = advice_on_missing("winding_degC", (600.0, 630.0), masks=((300.0, 330.0),))
    assert "mask = [[300.0, 330.0], [600.0, 630.0]]" in both


def test_missing_currents_leave_the_parts_that_have_them():
    end = float(CLEAN.time_s[-1])
    said = advice_on_missing("phase_current_A", (600.0, 640.0), (900.0, 940.0))
    assert "[tests.t] use = [[0.000, 599.9" in said
    assert f", {end:.3f}]] in the motor file" in said
    assert said.count("],") == 2
    assert "FROM" not in said
    late = advice_on_missing("winding_degC", (0.0, 40.0))
    assert "use = [[4" in late
    assert "mask" not in late


def test_a_channel_that_is_never_there_has_no_part_to_use():
    said = advice_on_missing("losses_W", (0.0, 1e9))
    assert "[tests" not in said
    assert "Export the channel again" in said


def test_a_test_under_two_minutes_says_what_it_can_tell():
    brief = heat_run(1, 1.5, currents=(120.0,), rounding=0.1)
    (finding,) = [one for one in check_record(brief, MOTOR) if one.id == "too_short"]
    assert "for 70 s from the first load on" in finding.message
    assert "Ceq_sr and Req_sr keep their priors" in finding.message
