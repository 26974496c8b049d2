"""Tests without current or without other losses are taken for what they are, no column faked."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from heated_bodies import BLOCK, COIL, LEADS_SHARE, coil, heater

import heatrun
from heatrun.checks import check_record
from heatrun.checks.excitation import single_step
from heatrun.checks.quick_fit import quick_fit
from heatrun.errors import InputError
from heatrun.fit.fit import fit
from heatrun.model.model import Model
from heatrun.model.problem import Problem
from heatrun.motor.file import load_motor
from heatrun.posterior.posterior import normal_draws
from heatrun.posterior.predict import predict
from heatrun.readers.joined import read_test
from heatrun.record.motor import Motor
from heatrun.record.record import Record
from heatrun.record.reduction import reduce


def problem(files, network):
    motor = load_motor(files[0])
    test = reduce(read_test(files[1], motor), motor)
    model = Model.of(network, motor).scaled(motor, [test])
    return Problem.of(model, motor, [test])


@pytest.fixture(scope="module")
def direct(tmp_path_factory):
    """Files of a coil under direct current, and the second order's fit to them."""
    files = coil(tmp_path_factory.mktemp("coil"), has_power=False)
    return files, fit(problem(files, "second"), num_starts=4)


def holds(found, true):
    for name, value in true.items():
        place = found.problem.parameters.index(name)
        off = found.z[place] - found.slots[place].parameter.score(value)
        assert abs(off) < 3.0 * np.sqrt(found.covariance[place, place]), name


def test_a_block_with_a_heater_needs_no_current_and_no_resistance(tmp_path):
    files = heater(tmp_path)
    assert not [f for f in heatrun.check(*files) if f.severity != "note"]
    found = fit(problem(files, "first"), num_starts=4)
    holds(found, BLOCK)
    assert "current_gain" not in found.problem.parameters.names
    assert quick_fit(read_test(files[1], load_motor(files[0])), load_motor(files[0])) is not None
    with pytest.raises(InputError, match="phase_current_A is missing"):
        problem(files, "second")
    files = heater(tmp_path, "phase_current_A = 0")
    assert not [f for f in heatrun.check(*files) if f.severity != "note"]
    assert "Rs0" not in problem(files, "second").parameters.names


@pytest.mark.parametrize("losses", ["map", "balance"])
def test_a_current_is_asked_for_where_it_heats(tmp_path, losses):
    motor_file, table = heater(tmp_path)
    motor = replace(load_motor(motor_file), losses=losses, phase_resistance_ohm=0.3)
    found = [f.id for f in check_record(read_test(table, motor), motor) if f.severity == "error"]
    assert found == (["missing_channel"] if losses == "map" else [])


STEPS, LEVEL = (30.0, 12.0, 45.0), (30.0, 30.0, 30.0)


@pytest.mark.parametrize(
    ("watts", "held", "is_single"),
    [
        (STEPS, {}, False),
        (STEPS, {"phase_current_A": 0.0}, False),
        (STEPS, {"phase_current_A": 0.0, "speed_rpm": 1500.0}, False),
        (LEVEL, {}, True),
        (LEVEL, {"phase_current_A": 0.0, "speed_rpm": 1500.0}, True),
        (LEVEL, {"phase_current_A": 7.0}, True),
    ],
)
def test_load_steps_are_counted_on_what_heats(watts, held, is_single):
    time_s = np.arange(0.0, 3600.0, 5.0)
    channels = {"time_s": time_s, "losses_W": np.repeat(watts, time_s.size // 3)}
    channels |= {name: np.full(time_s.size, value) for name, value in held.items()}
    found = single_step(Record("block", channels), Motor("block"))
    assert [f.id for f in found] == ["single_step"] * is_single
    heats = "phase_current_A" if held.get("phase_current_A") else "losses_W"
    assert all(heats in f.where for f in found)


def test_a_coil_under_direct_current_needs_no_losses_and_no_room_sensor(direct):
    files, found = direct
    assert not [f for f in heatrun.check(*files) if f.severity != "note"]
    holds(found, COIL)


def test_leads_are_named_where_the_meter_sees_more_than_the_copper(tmp_path):
    found = heatrun.check(*coil(tmp_path, has_power=True))
    (finding,) = [f for f in found if f.id == "standstill_losses"]
    assert finding.severity == "warning"
    assert "Leads" in finding.remedy
    # the leads stay cold while the winding warms: their share lies below that of 25 degC
    assert 0.2 < 1.0 - 1.0 / finding.values["ratio"] < LEADS_SHARE / (1.0 + LEADS_SHARE)


def test_a_constant_is_told_and_does_not_replace_a_column(tmp_path):
    motor_file, test = heater(tmp_path, "phase_current_A = 0")
    motor_file.write_text(motor_file.read_text() + "ambient_degC = 99\n")
    record = read_test(test, load_motor(motor_file))
    assert np.max(record["ambient_degC"]) < 22.0
    assert np.all(record["phase_current_A"] == 0.0)
    assert any("phase_current_A = 0 throughout" in note for note in record.notes)


@pytest.mark.parametrize("line", ["winding_degC = 20", "torque = 3", 'ambient_degC = "warm"'])
def test_constants_that_are_none_are_refused(tmp_path, line):
    (tmp_path / "motor.toml").write_text(f'[motor]\nname = "x"\n[constants]\n{line}\n')
    with pytest.raises(InputError, match="constants"):
        load_motor(tmp_path / "motor.toml")


def test_steps_too_long_for_a_draw_are_told(direct):
    _, found = direct
    draws = normal_draws(found).draws
    place = found.problem.parameters.index("Req_w")
    draws.vectors[:, place] = found.slots[place].parameter.score(1e-6)
    with pytest.raises(InputError, match="too fast for the steps"):
        predict(draws, found.problem.tests[0])
