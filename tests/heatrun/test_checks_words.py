"""What is said of a record fits it: its first causes, what is known and what is missing."""

import argparse
import ast
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from heat_runs import (
    CLEAN,
    LINK,
    MOTOR,
    as_columns,
    at,
    changed,
    decided,
    edited,
    every,
    fell_off,
    heat_run,
    late,
    named,
    shifted_clock,
    without,
)

import heatrun
from heatrun.checks import check_record, excitation
from heatrun.checks.advice import MotorFileLine, Remedy, in_one_line, use_line
from heatrun.checks.course import start_not_in_equilibrium
from heatrun.checks.quick_fit import quick_fit
from heatrun.checks.suitability import other_tests
from heatrun.checks.unexplained import unexplained_movement
from heatrun.checks.which_unit import read_as
from heatrun.cli import main
from heatrun.commands.calibrate import load
from heatrun.motor.file import load_motor, parse_motor
from heatrun.readers.joined import parts_of
from heatrun.record.derive import BY_CONSTANTS
from heatrun.record.findings import FAILED, IN_DOUBT, OUTPUT_FAILED, SAID, TITLE, meanings, page
from heatrun.record.motor import PartsOfTest
from heatrun.record.record import ColumnReading, Finding, Record
from heatrun.record.stretch import Stretch, cut


def test_a_long_test_is_not_called_too_short_for_its_length(monkeypatch):
    """Sixty minutes, a constant of some 900 s known to a factor of 1.6: four of them, not two."""
    record = heat_run(4, 60.0, step_s=1.0)
    quick = quick_fit(record, MOTOR)
    assert quick is not None
    unsure = replace(quick, taus_s=(60.0, 900.0), log_sd=0.5)
    monkeypatch.setattr(excitation, "quick_fit", lambda *_: unsure)
    monkeypatch.setattr(excitation, "settling_constants", lambda *_: 0.0)
    (finding,) = named(check_record(record, MOTOR), "too_short")
    assert finding.severity == "warning"
    assert "at least two" not in finding.message
    assert "between 331 and 2446 s" in finding.message


def test_a_slow_constant_that_may_be_the_fast_one_leaves_that_open_too(monkeypatch):
    record = at(CLEAN, CLEAN.time_s < 80.0)
    quick = quick_fit(CLEAN, MOTOR)
    assert quick is not None
    unsure = replace(quick, taus_s=(9.7, 54.0), log_sd=0.9)
    monkeypatch.setattr(excitation, "quick_fit", lambda *_: unsure)
    (finding,) = excitation.too_short(record, MOTOR)
    assert (finding.values["fast_from_s"], finding.values["fast_to_s"]) == (9.7, 54.0)
    assert "from 9 s on" in finding.message


@pytest.mark.parametrize("minutes", [2.0, 3.0, 5.0])
def test_minutes_tell_no_slow_constant(minutes):
    """Of a winding of 90 s and a stator of half an hour."""
    record = heat_run(4, minutes, currents=(120.0,), rounding=0.0, noise=0.05, step_s=0.5)
    (finding,) = named(check_record(record, MOTOR), "too_short")
    assert finding.severity == "warning"
    assert "stays open" in finding.message
    assert "time constants of about" not in finding.message
    assert finding.values["fast_from_s"] < 97.0 < 1.05 * finding.values["fast_to_s"]


def test_reader_findings_come_first():
    own = Finding("reader", "note", "Seen by the reader.")
    found = check_record(replace(CLEAN, findings=(own,)), MOTOR)
    assert found[0] == replace(own, test="run")
    assert len(found) > 1


def test_a_missing_loss_is_told_beside_the_power_of_the_link():
    record = without(without(LINK, "losses_W"), "phase_current_A")
    motor = replace(MOTOR, losses="map")  # of which the copper loss is no part
    found = {f.where: f.remedy for f in named(check_record(record, motor), "missing_channel")}
    assert "torque_Nm" in found["run, losses_W"]
    assert "[constants] speed_rpm = 0" in found["run, losses_W"]
    assert "dc_current_A is not" in found["run, phase_current_A"]
    plain = named(check_record(without(CLEAN, "losses_W"), MOTOR), "missing_channel")
    assert "torque_Nm" not in plain[0].remedy


def test_a_power_that_is_called_that_of_the_terminals_is_none_of_a_link():
    link = every(changed(LINK, losses_W=300.0 * LINK["dc_current_A"]), 20)
    assert named(check_record(link, MOTOR), "losses_of_dc_link")
    power = ColumnReading("electrical_power_W", "P [W]", "W", "stated", "[columns]", "t.csv")
    known = replace(changed(link, electrical_power_W=link["losses_W"]), mapping=(power,))
    assert not named(check_record(known, MOTOR), "losses_of_dc_link")


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


def test_a_test_that_is_cut_while_warm_is_told_how_its_stator_can_be_known():
    late = cut(CLEAN, Stretch(1800.0), "asked for")
    (finding,) = named(check_record(late, MOTOR), "cut_while_warm")
    assert "is not simulated" in finding.message
    assert "mask = [[60, 1800]] under [tests.NAME]" in finding.remedy
    begin = parts_of(CLEAN, replace(MOTOR, tests={"run": PartsOfTest(mask=((60.0, 1800.0),))}))
    assert not named(check_record(begin[0], MOTOR), "cut_while_warm")


def test_coolant_replaces_ambient_where_it_is_the_sink():
    record = changed(without(CLEAN, "ambient_degC"), coolant_degC=CLEAN["ambient_degC"])
    assert named(check_record(record, MOTOR), "missing_channel")
    cooled = replace(MOTOR, sink="coolant")
    assert all(f.severity == "note" for f in check_record(record, cooled))


def test_a_plain_ampere_is_not_said_to_be_stated_as_rms():
    current = ColumnReading("phase_current_A", "I [A]", "A_rms", "stated", "[columns]", "t.csv")
    assert read_as(current).endswith("a plain A counts as rms")
    peak = replace(current, unit="A_peak")
    assert read_as(peak) == "A_peak, as the file or [columns] states"
    assert read_as(replace(current, unit_from="assumed")) == "A_rms, assumed, no unit given"


SLOW = every(CLEAN, 20)  # 2 s
DETACHED = "sensor_detached"


def warned(record: Record) -> list[Finding]:
    """What is more than a note."""
    return [one for one in check_record(record, MOTOR) if one.severity != "note"]


def errors(record: Record) -> list[str]:
    return [one.id for one in warned(record) if one.severity == "error"]


def test_three_faults_are_three_findings():
    record = fell_off(SLOW, 1500.0)
    time_s = record.time_s.copy()
    time_s[1400:] -= 2000.0
    shaft_W = 0.6 * record["losses_W"]
    power = (record["losses_W"] + shaft_W) / 1e3
    struck = changed(
        record, time_s=time_s, electrical_power_W=power, mechanical_power_W=shaft_W,
        losses_W=power - shaft_W,
    )  # fmt: skip
    columns = as_columns(struck)
    kept = tuple(one for one in columns.mapping if one.channel != "losses_W")
    found = warned(Record("run", struck.channels, mapping=kept))
    assert [one.id for one in found] == ["time_backwards", "unit_suspected", "sensor_detached"]


LINE = re.compile(r"(\[tests\.run\]) ((use|use_rows|mask|bridge) = .*?) in the motor file")


def as_advised(record: Record) -> tuple[Record, ...]:
    """The record with all that is advised for it in its motor file, word for word."""
    lines = {line.groups()[:2] for one in check_record(record, MOTOR)
             for line in LINE.finditer(one.remedy)}  # fmt: skip
    text = "\n".join(["[tests.run]", *(line for _, line in sorted(lines))])
    said = parse_motor(f'[motor]\nname = "M"\n{text}\n'.encode(), "motor.toml")
    return parts_of(record, replace(MOTOR, tests=said.tests))


def test_what_several_findings_advise_is_one_line():
    record = fell_off(SLOW, 900.0)
    time_s, first = record.time_s.copy(), int(np.searchsorted(record.time_s, 1800.0))
    winding = np.where(time_s < 1800.0, record["winding_degC"], SLOW["winding_degC"])
    time_s[first:] -= 1700.0
    record = changed(record, time_s=time_s, winding_degC=winding)
    assert errors(record) == ["time_backwards", "sensor_detached"]
    parts = as_advised(record)
    assert [part.first_row for part in parts] == [1, first + 1]
    assert parts[0].time_s[-1] == pytest.approx(900.0, abs=5.0)
    assert not [one for part in parts for one in errors(part)]


@pytest.mark.parametrize(
    ("key", "one", "other", "said"),
    [
        ("mask", [(60.0, 90.0)], [(30.0, 40.0), (60.0, 90.0)], "[[30.0, 40.0], [60.0, 90.0]]"),
        ("use", [(0.0, 9.0), (10.0, 20.0)], [(4.0, 20.0)], "[[4.000, 9.000], [10.000, 20.000]]"),
        ("use_rows", [(1, 9), (10, 20)], [(1, 5), "…"], "[[1, 5], [10, 20]]"),
        ("use_rows", [(1, 9), "…"], [(4, 12), "…"], "[[4, 9], …]"),
    ],
)
def test_two_lines_of_a_key_are_one(key, one, other, said):
    """What is used is what both use, what is left out that of both; other keys stay."""
    bridge = MotorFileLine("[tests.run]", "bridge", ((5.0, 6.0),))
    lines = [
        MotorFileLine("[tests.run]", key, tuple(w for w in each if w != "…"), "…" in each)
        for each in (one, other)
    ]
    for advised in (lines, lines[::-1]):
        told = [Remedy("Check it: ", line, ". Again: ", bridge, ".") for line in advised]
        found = in_one_line([Finding("a", "error", "", remedy=each) for each in told])
        others = " (… the other parts)" if "…" in said else ""
        assert {one.remedy for one in found} == {
            f"Check it: [tests.run] {key} = {said} in the motor file{others}. "
            "Again: [tests.run] bridge = [[5.0, 6.0]] in the motor file."
        }


def test_a_sensor_that_sticks_and_falls_is_left_out_by_one_line():
    held = edited(SLOW, "winding_degC", 700.0, 1100.0, 45.0)
    winding = np.where(SLOW.time_s < 2000.0, held["winding_degC"], 850.0)
    winding[SLOW.time_s > 2100.0] = SLOW["winding_degC"][SLOW.time_s > 2100.0]
    record = changed(SLOW, winding_degC=winding)
    assert len(errors(record)) == 2
    (part,) = as_advised(record)
    assert errors(part) == []


def test_a_logger_that_starts_again_at_zero_has_one_cause():
    first = int(np.searchsorted(SLOW.time_s, 1800.0))
    time_s = np.where(SLOW.time_s < 1800.0, SLOW.time_s, SLOW.time_s - 1800.0)
    again = Finding("logger_restarted", "warning", "Again.", values={
        "count": 1, "first_sample": first})  # fmt: skip
    later = replace(SLOW, findings=(again,))
    assert named(check_record(later, MOTOR), "logger_restarted")
    record = replace(later, channels=changed(SLOW, time_s=time_s).channels)
    told = {one.id: one for one in check_record(record, MOTOR)}
    assert "logger_restarted" not in told
    assert "the logger was started again" in told["time_backwards"].message
    parts = as_advised(record)
    assert len(parts) == 2
    again = {one.id for part in parts for one in check_record(part, MOTOR)}
    assert not again & {"logger_restarted", "time_backwards"}


def test_a_sensor_that_is_off_for_a_while_costs_that_while():
    off = (SLOW.time_s > 1500.0) & (SLOW.time_s < 1800.0)
    record = changed(SLOW, winding_degC=np.where(off, 25.0, SLOW["winding_degC"]))
    (part,) = as_advised(record)
    assert part.time_s.size == SLOW.time_s.size
    assert np.sum(np.isnan(part["winding_degC"])) == pytest.approx(np.sum(off), abs=3)
    assert errors(part) == []


LIVE = (
    SLOW["winding_degC"] - 8.0 + 0.05 * np.random.default_rng(7).standard_normal(SLOW.time_s.size)
)
BESIDE = {
    "comes off": ("temperature_jump", lambda s, T: np.where(s < 1500.0, T, 22.0)),
    "sticks": ("sensor_stuck", lambda s, T: np.where(s < 3000.0, T, T[s >= 3000.0][0])),
    "opens": ("sensor_detached", lambda s, T: np.where((s < 1500.0) | (s > 1520.0), T, 850.0)),
}


@pytest.mark.parametrize(
    ("name", "channel"),
    [*((name, "housing_degC") for name in BESIDE), ("opens", "end_winding_degC")],
)
def test_a_body_that_is_off_is_told_once_and_the_test_goes_on_without(name, channel):
    id, struck = BESIDE[name]
    record = changed(SLOW, **{channel: struck(SLOW.time_s, LIVE)})
    (finding,) = warned(record)
    assert finding.id == id
    assert channel in finding.where
    assert f'{channel} = "none" under [columns]' in finding.remedy
    assert not warned(changed(SLOW, **{channel: LIVE}))


def test_a_sink_that_jumps_is_not_told_to_move_too():
    fallen = np.where(SLOW.time_s < 1500.0, SLOW["ambient_degC"], 5.0)
    (told,) = warned(changed(SLOW, ambient_degC=fallen))
    assert told.id == "temperature_jump"


def test_an_offset_of_the_torque_is_not_told_as_a_warm_start():
    """The offset, times speed, takes the losses below nothing from the first load on."""
    rest = SLOW.time_s < 120.0
    later = {  # the machine rests for two minutes first
        name: np.interp(SLOW.time_s - 120.0, SLOW.time_s, SLOW[name])
        for name in ("winding_degC", "phase_current_A", "losses_W", "speed_rpm")
    }
    loads = {n: np.where(rest, 0.0, v) for n, v in later.items() if n != "winding_degC"}
    offset_Nm = 4.0
    loads["losses_W"] -= offset_Nm * loads["speed_rpm"] * np.pi / 30.0
    torque_Nm = np.where(rest, 0.0, 40.0) + offset_Nm
    record = changed(SLOW, **{**later, **loads}, torque_Nm=torque_Nm)
    told = {one.id for one in check_record(record, MOTOR)}
    assert "shaft_power_disagrees" in told
    assert "start_not_in_equilibrium" not in told


def test_a_marker_near_the_load_is_told_by_the_losses():
    """0x3FF in tenths, less than twice the current of the test."""
    low = heat_run(5, currents=(40.0, 55.0, 30.0, 50.0), step_s=2.0)
    copper = MOTOR.copper_loss_W(low["phase_current_A"], low["winding_degC"])
    low = changed(low, losses_W=1.2 * copper + 1.0)
    struck = edited(low, "phase_current_A", 1000.0, 1006.0, 102.3)
    (finding,) = named(check_record(struck, MOTOR), "load_spike")
    assert "0x3FF in units of 1/10" in finding.message
    (part,) = as_advised(struck)
    assert not named(check_record(part, MOTOR), "load_spike")
    other = edited(low, "phase_current_A", 1000.0, 1006.0, 102.0)
    assert not named(check_record(other, MOTOR), "load_spike")


def test_a_part_in_rows_is_cut_in_rows():
    """Its clock was set back: a time stands in both parts, a row in one."""
    record = fell_off(SLOW, 1500.0)
    time_s = record.time_s.copy()
    size, first = time_s.size, int(np.searchsorted(time_s, 1800.0))
    time_s[first:] -= 1700.0
    whole = replace(changed(record, time_s=time_s), name="run")

    def advised(*pairs: tuple[int, int]) -> str:
        use = tuple(Stretch(*pair, in_rows=True) for pair in pairs)
        parts = parts_of(whole, replace(MOTOR, tests={"run": PartsOfTest(use=use)}))
        found = [one for part in parts for one in named(check_record(part, MOTOR), DETACHED)]
        return " ".join(one.remedy for one in found)

    told = advised((1, first), (first + 1, size))
    pair = re.search(r"\[tests.run\] use_rows = \[\[1, (\d+)\], …\] in the motor file", told)
    assert pair is not None
    assert "(… the other parts)" in told
    last = int(pair[1])
    assert last < first
    assert SLOW.time_s[last - 1] == pytest.approx(1500.0, abs=5.0)
    assert not advised((1, last))
    nothing = use_line(replace(SLOW, first_row=901))
    assert nothing == "take [901, 2700] out of [tests.run] use_rows in the motor file"


def test_a_sensor_that_is_put_back_is_left_out_between():
    record = fell_off(SLOW, 1500.0)
    winding = np.where(record.time_s < 2200.0, record["winding_degC"], SLOW["winding_degC"])
    record = changed(record, winding_degC=winding)
    assert errors(record) == [DETACHED]
    (finding,) = named(check_record(record, MOTOR), DETACHED)
    assert "mask = [[1" in finding.remedy
    assert finding.values["until_s"] == pytest.approx(2200.0, abs=5.0)


def test_a_sensor_that_fails_early_teaches_nothing_false():
    """Nine tenths of the record show air that no load warms."""
    moved = unexplained_movement(fell_off(SLOW, 400.0), MOTOR)
    assert moved is not None
    assert moved.from_s == pytest.approx(400.0, abs=4.0)


@pytest.mark.parametrize("seed", range(4))
def test_a_load_that_steps_explains_what_the_winding_does(seed):
    clean = heat_run(100 + seed, 60.0, step_s=2.0, rounding=(0.0, 0.1, 1.0, 1.0)[seed], noise=0.05)
    assert unexplained_movement(clean, MOTOR) is None


def test_a_steady_load_tells_its_rise():
    steady = np.full(SLOW.time_s.size, 82.0)
    steady[::7] += 0.1
    record = changed(
        SLOW, winding_degC=steady, ambient_degC=0.0 * steady + 22.0, losses_W=0.0 * steady + 300.0,
        phase_current_A=0.0 * steady + 90.0,
    )  # fmt: skip
    (finding,) = named(check_record(record, MOTOR), "no_heating")
    assert "60.0 K at 300 W, 0.2 K/W" in finding.message


def test_amplitudes_are_told_once():
    peaks = decided(changed(SLOW, phase_current_A=np.sqrt(2.0) * SLOW["phase_current_A"]))
    (told,) = warned(peaks)
    assert told.id == "losses_below_copper"
    assert "[A_peak]" in told.remedy


def test_input_power_for_losses_is_not_told_of_the_clock_too():
    """A small motor in a strong wind: its losses make 5 W/K and 90 s, the input power 40 W/K."""
    time_s = np.arange(0.0, 2400.0, 2.0)
    winding = 22.0 + 70.0 * -np.expm1(-time_s / 90.0)
    torque = np.full(time_s.size, 3.2)
    losses = np.full(time_s.size, 350.0)
    shaft = torque * 8000.0 * np.pi / 30.0
    record = as_columns(Record(
        "run",
        {"time_s": time_s, "winding_degC": np.round(winding, 1), "losses_W": losses + shaft,
         "ambient_degC": np.full(time_s.size, 22.0), "torque_Nm": torque,
         "speed_rpm": np.full(time_s.size, 8000.0)},
    ))  # fmt: skip
    told = {one.id for one in check_record(record, MOTOR)}
    assert "losses_of_shaft" in told
    assert "unit_suspected" not in told


def test_a_sensor_below_its_housing_through_short_pulses_is_told_from_where_it_fell():
    """Pulses of 40 s: no one of them is long enough by itself."""
    time_s = np.arange(0.0, 3600.0)
    loaded = time_s % 80.0 < 40.0
    losses = np.where(loaded, 400.0, 0.0)
    housing = 24.0 + 40.0 * -np.expm1(-time_s / 800.0)
    swing = np.where(loaded, time_s % 80.0, 80.0 - time_s % 80.0) * 0.6
    winding = housing + 4.0 + swing
    off = time_s > 2000.0
    fallen = 24.0 + (winding[2000] - 24.0) * np.exp(-(time_s[off] - 2000.0) / 25.0)
    winding[off] = fallen
    record = Record(
        "run",
        {"time_s": time_s, "winding_degC": np.round(winding, 1), "losses_W": losses,
         "housing_degC": np.round(housing, 1), "ambient_degC": np.full(time_s.size, 24.0),
         "phase_current_A": np.where(loaded, 120.0, 0.0)},
    )  # fmt: skip
    (finding,) = named(check_record(record, MOTOR), DETACHED)
    assert finding.values["from_s"] == pytest.approx(2000.0, abs=60.0)
    assert "use = [[0.000, " in finding.remedy


def test_a_shift_below_the_housing_is_told_as_the_shift_alone():
    housing = SLOW["winding_degC"] - 5.0
    shifted = np.where(SLOW.time_s < 1500.0, SLOW["winding_degC"], SLOW["winding_degC"] - 14.0)
    record = changed(SLOW, winding_degC=shifted, housing_degC=housing)
    assert errors(record) == ["temperature_jump"]


@pytest.mark.parametrize(("loose_K", "at_s"), [(0.0, 0.0), (9.0, 1100.0), (9.0, 930.0)])
def test_a_small_winding_falls_fast_as_its_load_goes(loose_K, at_s):
    """A drone's motor: 12 J/K and 0.45 K/W over a stator of 90 J/K in its wash, by Euler steps."""
    time_s = np.arange(0.0, 1800.0)
    losses = np.where((time_s < 60.0) | (time_s % 300.0 > 240.0), 0.0, 110.0)
    winding, stator, read = 24.0, 24.0, []
    for watts in np.repeat(losses, 20):
        across = (winding - stator) / 0.45
        winding += 0.05 * (watts - across) / 12.0
        stator += 0.05 * (across - (stator - 24.0) / 0.5) / 90.0
        read.append(winding)
    reading = np.array(read)[19::20] + 0.05 * np.random.default_rng(5).standard_normal(time_s.size)
    assert np.diff(reading).min() < -7.5
    record = Record("run", {
        "time_s": time_s, "winding_degC": np.round(reading - loose_K * (time_s > at_s), 2),
        "losses_W": losses, "phase_current_A": np.where(losses > 0.0, 30.0, 0.0),
        "ambient_degC": np.full(time_s.size, 24.0),
    })  # fmt: skip
    told = named(check_record(record, MOTOR), "temperature_jump")
    assert [one.severity for one in told] == (["error"] if loose_K else [])
    assert all(one.values["from_s"] == pytest.approx(at_s, abs=2.0) for one in told)


def test_a_small_motor_at_one_load_reads_the_same_whole_degree_for_long():
    """A drone's motor in its wash, which ends with the load: one rise, one fall, and between them
    40 minutes at 89 to 91 °C. By Euler steps; the rotor, which no network has, warms for long.
    """
    time_s = np.arange(0.0, 3000.0)
    is_on = (time_s > 90.0) & (time_s < 2870.0)
    losses = np.where(is_on, 135.0, 0.0)
    ambient = 24.0 + 0.3 * np.sin(time_s / 700.0)
    winding, stator, rotor, read = 24.0, 24.0, 24.0, []
    for watts, air in zip(np.repeat(losses, 10), np.repeat(ambient, 10), strict=True):
        across, to_rotor = (winding - stator) / 0.3, (stator - rotor) / 3.0
        to_air = (stator - air) / (0.2 if watts else 0.9)
        winding += 0.1 * (watts - across) / 20.0
        stator += 0.1 * (across - to_rotor - to_air) / 150.0
        rotor += 0.1 * (to_rotor - (rotor - air) / (0.6 if watts else 2.0)) / 250.0
        read.append(winding)
    noise_K = 0.15 * np.random.default_rng(1).standard_normal(time_s.size)
    record = Record("run", {
        "time_s": time_s, "winding_degC": np.round(np.array(read)[9::10] + noise_K),
        "losses_W": losses, "phase_current_A": np.where(is_on, 25.0, 0.0),
        "ambient_degC": np.round(ambient, 1),
    })  # fmt: skip
    assert errors(record) == []
    held = np.where((time_s > 100.0) & (time_s < 1300.0), 60.0, record["winding_degC"])
    assert "sensor_stuck" in errors(changed(record, winding_degC=held))


def motor(*names: str):
    sections = "".join(f'[tests."{name}"]\nmask = [[600, 630]]\n' for name in names)
    return parse_motor(f'[motor]\nname = "M"\n{sections}'.encode(), "motor.toml")


def test_a_section_of_a_given_test_or_of_its_parts_is_no_finding():
    assert not list(other_tests(motor(), ["duty"]))
    assert not list(other_tests(motor("duty"), ["duty"]))
    assert not list(other_tests(motor("duty"), ["duty_1", "duty_2"]))


@pytest.mark.parametrize("name", ["step", "run_002", "Test_2024_03_05_002"])
def test_a_section_of_another_test_is_a_note(name):
    (found,) = other_tests(motor(name), ["duty", "run_001", "Test_2024_03_05_001"])
    assert found.severity == "note"
    assert found.message.startswith(f"[tests.{name}] of the motor file is for none")


@pytest.mark.parametrize("name", ["dtuy_90min", "Duty_90min", "duty_90min.csv", "duty-90min"])
def test_a_mistyped_name_is_a_warning_with_the_right_one(name):
    (found,) = other_tests(motor(name), ["duty_90min"])
    assert found.severity == "warning"
    assert "Did you mean [tests.duty_90min]?" in found.remedy


def test_a_test_that_has_its_own_section_is_not_the_one_that_was_meant():
    (found,) = other_tests(motor("step", "stepp"), ["step"])
    assert found.severity == "note"


@pytest.fixture
def bench(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    record = replace(CLEAN, channels={k: v[::10] for k, v in CLEAN.channels.items()})
    np.savetxt("duty.csv", np.stack(list(record.channels.values()), axis=1), "%.7g", ",",
               header=",".join(record.channels), comments="")  # fmt: skip
    text = '[motor]\nname = "M"\n[winding]\nphase_resistance_ohm = 0.0062\n'
    (tmp_path / "motor.toml").write_text(f"{text}[tests.dutty]\nmask = [[600, 630]]\n")
    return tmp_path


def test_check_finds_it(bench, capsys):
    assert main(["check", "motor.toml", "duty.csv", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    (found,) = [one for one in said["findings"] if one["id"] == "other_test"]
    assert "[tests.duty]" in found["remedy"]


def test_check_says_plainly_that_a_section_is_for_another_test(bench, capsys):
    file = bench / "motor.toml"
    file.write_text(file.read_text().replace("dutty", "test"))
    assert main(["check", "motor.toml", "duty.csv"]) == 0
    assert "[tests.test] of the motor file is for none of the tests" in capsys.readouterr().out


def test_a_command_that_fits_says_it(bench, capsys):
    options = argparse.Namespace(command="calibrate", json=False)
    load(options, load_motor("motor.toml"), [bench / "duty.csv"], [])
    assert "[tests.dutty] of the motor file is for none of the tests" in capsys.readouterr().err


CORE = Path(heatrun.__file__).parent
PAGE = Path(__file__).parents[2] / "docs" / "findings.md"


def texts(node):
    """Yield the texts that an expression may be: of a conditional, both."""
    for each in ast.walk(node):
        if isinstance(each, ast.Constant) and isinstance(each.value, str):
            yield each.value


def ids():
    """Yield the ids of the findings that the code of the core makes, with their place."""
    for path in CORE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "Finding":
                named = [each.value for each in node.keywords if each.arg == "id"]
                (id,) = named or node.args[:1]
                if not isinstance(id, ast.Name):  # a constant of the module, or an argument
                    test = {*texts(id.test)} if isinstance(id, ast.IfExp) else set()
                    yield from ((each, path.name) for each in texts(id) if each not in test)


def test_a_spike_of_the_sink_costs_no_column():
    record = edited(CLEAN, "ambient_degC", 1000.0, 1000.2, 90.0)
    (jump,) = named(check_record(record, MOTOR), "temperature_jump")
    assert jump.severity == "warning"
    assert '"none"' not in jump.remedy


def test_every_finding_is_in_the_register():
    found = dict(ids())
    assert len(found) > 50
    assert not {id: place for id, place in found.items() if id not in meanings()}


def test_the_register_holds_no_other():
    register = CORE / "record" / "findings.py"
    text = "".join(path.read_text("utf-8") for path in CORE.rglob("*.py") if path != register)
    told = {*meanings()} - {FAILED, OUTPUT_FAILED}  # those two come from the register itself
    assert not [id for id in told if f'"{id}"' not in text]
    assert {*SAID, *(id for ids in IN_DOUBT.values() for id in ids)} <= meanings().keys()


def test_the_page_is_that_of_the_register():
    assert PAGE.read_text("utf-8") == TITLE + page(), "run `make docs`"


OF_A_CONSTANT = (f"ambient_degC = 0 {BY_CONSTANTS}",)


def test_a_constant_in_fahrenheit_is_corrected_where_it_stands():
    sink = np.full(SLOW.time_s.size, float(np.median(SLOW["ambient_degC"][:20])) * 1.8 + 32.0)
    record = replace(changed(SLOW, ambient_degC=sink), notes=OF_A_CONSTANT)
    (finding,) = warned(record)
    assert finding.id == "units_temperature"
    at_rest = f"{(sink[0] - 32.0) / 1.8:.1f}"
    assert finding.remedy.startswith(f"Write ambient_degC = {at_rest} under [constants]")


def test_a_constant_that_is_no_ambient_of_a_winding_at_rest_is_named():
    rest_s = 900.0
    later = {
        name: np.interp(SLOW.time_s - rest_s, SLOW.time_s, SLOW[name])
        for name in ("winding_degC", "phase_current_A", "losses_W")
    }
    for name in ("phase_current_A", "losses_W"):
        later[name] = np.where(SLOW.time_s < rest_s, 0.0, later[name])
    sink = np.full(SLOW.time_s.size, later["winding_degC"][0] - 10.0)
    record = changed(SLOW, **later, ambient_degC=sink)

    def remedy(record):
        found = check_record(record, MOTOR)
        return next(one.remedy for one in found if one.id == "start_not_in_equilibrium")

    assert f"ambient_degC = {sink[0] + 10.0:.1f}" in remedy(replace(record, notes=OF_A_CONSTANT))
    assert "after a soak" in remedy(record)


@pytest.mark.parametrize(
    ("housing", "says", "line"),
    [(lambda T: 22.0 + 0.5 * (T - 22.0), "the two columns are exchanged", 'winding_degC = "'),
     (lambda T: 32.0 + 1.8 * (22.0 + 0.6 * (T - 22.0)), "the housing looks like °F", "[degF]")],
)  # fmt: skip
def test_a_winding_below_its_housing_all_along_is_told_by_its_cause(housing, says, line):
    cooler = housing(SLOW["winding_degC"])
    is_exchanged = "exchanged" in says
    pair = (cooler, SLOW["winding_degC"]) if is_exchanged else (SLOW["winding_degC"], cooler)
    record = changed(SLOW, winding_degC=pair[0], housing_degC=pair[1])
    assert errors(record) == [DETACHED]
    (finding,) = named(check_record(record, MOTOR), DETACHED)
    assert says in finding.message
    assert line in finding.remedy
    right = changed(SLOW, housing_degC=22.0 + 0.5 * (SLOW["winding_degC"] - 22.0))
    assert not errors(right)


def test_a_winding_as_cold_as_the_room_is_not_exchanged_with_its_housing():
    warm = at(SLOW, SLOW.time_s > 0.6 * SLOW.time_s[-1])
    housing = 70.0 + 0.1 * (warm["winding_degC"] - warm["winding_degC"].min())
    hangs = warm["ambient_degC"] + 4.0 + 0.05 * (warm["winding_degC"] - warm["winding_degC"].min())
    record = changed(warm, winding_degC=hangs, housing_degC=housing)
    (finding,) = named(check_record(record, MOTOR), DETACHED)
    assert "less than its housing under load" in finding.message
    assert "exchanged" not in finding.sentence()


def test_losses_that_are_missing_for_a_while_are_checked_for_completeness():
    record = edited(CLEAN, "losses_W", 1000.0, 1130.0, lambda P: -0.001 * P)
    (finding,) = named(check_record(record, MOTOR), "losses_below_copper")
    assert finding.remedy.startswith("Check whether the losses are complete, and ")


@pytest.mark.parametrize(
    ("by_s", "id", "said"),
    [(-3600.0, "time_backwards", "daylight saving ends"), (3600.0, "time_gap", "saving begins")],
)
def test_the_hour_of_daylight_saving_is_named(by_s, id, said):
    record = replace(shifted_clock(SLOW, 1800.0, by_s), clock_s=2.5 * 3600.0)
    assert errors(record) == [id]
    (finding,) = named(check_record(record, MOTOR), id)
    assert said in finding.message
    assert "in UTC" in finding.remedy
    by_day = replace(record, clock_s=12.5 * 3600.0)
    assert not [one for one in check_record(by_day, MOTOR) if "saving" in one.message]


def test_a_winding_that_warms_before_any_load_tells_of_the_clocks():
    rests = heat_run(currents=(0.0, 150.0, 100.0, 150.0), minutes=40.0, step_s=1.0)
    (found,) = start_not_in_equilibrium(late(rests, 60.0), MOTOR)
    assert "It warms before any load" in found.message
    said = re.search(r"at least (\d+) s", found.remedy)
    assert said is not None
    assert 40.0 < float(said[1]) <= 60.0
    assert "load_offset" in found.remedy
