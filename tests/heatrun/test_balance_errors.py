"""What the inputs of a test tell of its torque and powers, and who takes it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from measured_machine import measured_record

from heatrun.checks import check_record
from heatrun.export import Corrections
from heatrun.fit.fit import fit
from heatrun.model.bodies import corrected_losses
from heatrun.model.model import Model
from heatrun.model.problem import Problem
from heatrun.posterior.posterior import sample
from heatrun.posterior.predict import predict
from heatrun.record.balance_errors import told_by_inputs
from heatrun.record.motor import ParameterOverride
from heatrun.record.reduction import reduce
from heatrun.runs.machine import tested as seen_in

GAIN = 0.05
NUM_LOADS = 16
LENGTH_S = 5400.0
"""Of both tests, so that they share what is compiled [s]."""


@pytest.fixture(scope="module")
def driven(generator):
    """A staircase, with a torque of the scale of the electrical power."""
    return measured_record(
        generator, generator.staircase(LENGTH_S), 82, "driven", stator=False, shaft_gain=0.0
    )


@pytest.fixture(scope="module")
def both_ways(generator):
    """Loads that last for some minutes, as a motor more often than not, and 5 % off in torque."""
    rng = np.random.default_rng(6)
    loads = [
        generator.Segment(float(length), float(torque), float(speed))
        for length, torque, speed in zip(
            rng.integers(120, 500, NUM_LOADS), rng.uniform(-0.6, 0.9, NUM_LOADS),
            rng.uniform(0.3, 1.0, NUM_LOADS), strict=True,
        )
    ]  # fmt: skip
    rest_s = LENGTH_S - 60.0 - sum(load.duration_s for load in loads)
    rests = [generator.Segment(length, 0.0, 0.0) for length in (60.0, rest_s)]
    profile = generator.Profile((rests[0], *loads, rests[1]))
    return measured_record(generator, profile, 83, "both ways", stator=False, shaft_gain=GAIN)


def changed(record, **channels):
    return replace(record, channels={**record.channels, **channels})


def without_readings(record):
    """The record, its winding held at the reading after a minute."""
    winding = record["winding_degC"].copy()
    winding[60:] = winding[60]
    return changed(record, winding_degC=winding)


def fitted(motor, *records):
    tests = [reduce(record, motor) for record in records]
    return fit(Problem.of(Model.of("second", motor), motor, tests))


def errors(posterior, record, motor, **known):
    """RMSE of the held-out prediction [K], and share of the readings inside its 95 % band [1]."""
    test = replace(reduce(without_readings(record), motor), **known)
    found = predict(posterior, test)
    measured = reduce(record, motor).measured
    low, high = found.total["95"]
    inside = float(np.mean((measured >= low) & (measured <= high)))
    return float(np.sqrt(np.mean((measured - found.median) ** 2))), inside


@pytest.fixture(scope="module")
def calibrated(driven, motor):
    return sample(fitted(motor, driven), method="quick")


def test_a_held_out_test_takes_its_gain_from_its_own_inputs(calibrated, both_ways, motor):
    rmse_K, inside = errors(calibrated, both_ways, motor)
    assert rmse_K < 1.5  # 0.9 K
    assert inside > 0.9
    rmse_K, inside = errors(calibrated, both_ways, motor, told=())
    assert rmse_K > 5.0
    assert inside < 0.5


def test_a_fitted_test_has_its_own_gain_and_leaves_the_shared_one(driven, both_ways, motor, truth):
    found = fitted(motor, driven, both_ways)
    values, sd = found.values(), np.sqrt(np.diag(found.covariance))
    assert values["own_shaft_power_gain[both ways]"] == pytest.approx(GAIN, abs=0.002)
    assert abs(values["shaft_power_gain"]) < 0.01
    for name, true in truth.items():
        place = found.problem.parameters.index(name)
        assert abs(found.z[place] - found.slots[place].parameter.score(true)) < 3.0 * sd[place]


def test_the_temperature_of_the_winding_is_not_looked_at(both_ways, motor):
    assert told_by_inputs(both_ways, motor) == told_by_inputs(without_readings(both_ways), motor)


def finding(record, motor):
    (found,) = [f for f in check_record(record, motor) if f.id == "shaft_power_disagrees"]
    return found


@pytest.mark.parametrize(
    ("said", "is_own", "words"),
    [
        (None, True, "takes shaft_power_gain = 0.0"),
        (ParameterOverride(sd=0.01), True, "fixed = 0"),
        (ParameterOverride(value=-0.02), True, "takes shaft_power_gain"),
        (ParameterOverride(fixed=0.0), False, "The motor file holds shaft_power_gain at 0"),
        (ParameterOverride(sd=0.03), False, ""),  # the prior allows for it
        (ParameterOverride(value=0.05), False, ""),
    ],
)
def test_the_motor_file_may_state_otherwise(said, is_own, words, both_ways, motor):
    if said is not None:
        motor = replace(motor, parameters={"shaft_power_gain": said})
    assert bool(reduce(both_ways, motor).told) == is_own
    if words:
        assert words in finding(both_ways, motor).sentence()
    else:
        assert told_by_inputs(both_ways, motor) == ()


def with_errors(record, *, watts=0.0, torque_Nm=0.0, way=1.0):
    """The record with errors of power and torque, and with another direction of rotation."""
    speed, torque = way * record["speed_rpm"], way * record["torque_Nm"]
    losses = record["losses_W"] + watts - torque_Nm * speed * np.pi / 30.0
    return changed(record, speed_rpm=speed, torque_Nm=torque + torque_Nm, losses_W=losses)


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({}, {}),
        ({"watts": -70.0}, {"shaft_power_offset": -70.0}),
        ({"torque_Nm": 1.4}, {"torque_offset": -1.4}),
        ({"torque_Nm": 0.07}, {}),  # the prior allows for it
        ({"way": True}, {}),
        ({"way": True, "torque_Nm": 0.4}, {"torque_offset": -0.4}),
    ],
)
def test_standstill_and_both_directions_of_rotation_show_offsets(wrong, told, driven, motor):
    turns = np.where(driven.time_s // 230.0 % 2 < 1, 1.0, -1.0)
    record = with_errors(driven, **{**wrong, **({"way": turns} if "way" in wrong else {})})
    found = {each.name: each.mean for each in reduce(record, motor).told}
    assert found == pytest.approx(told, rel=0.01)


def test_a_held_out_test_takes_the_zero_of_its_torque(calibrated, driven, motor):
    record = with_errors(driven, torque_Nm=1.4)
    rmse_K, inside = errors(calibrated, record, motor)
    assert rmse_K < 1.5
    assert inside > 0.9
    assert errors(calibrated, record, motor, told=())[0] > 5.0


def test_losses_below_zero_are_explained_by_what_the_inputs_tell(driven, motor):
    def severities(torque_Nm):
        found = check_record(with_errors(driven, torque_Nm=torque_Nm), motor)
        return {f.severity for f in found if f.id in ("losses_negative", "losses_below_copper")}

    assert severities(4.0) == {"note"}
    held = replace(motor, parameters={"torque_offset": ParameterOverride(fixed=0.0)})
    assert "error" in {f.severity for f in check_record(with_errors(driven, torque_Nm=4.0), held)}


def test_losses_of_zero_or_less_are_said_in_words(driven, motor):
    record = changed(driven, losses_W=-np.abs(driven["losses_W"]))
    said = [f.message for f in check_record(record, motor) if f.id == "losses_below_copper"]
    assert said
    assert "they are zero or less" in said[0]


def test_an_export_is_corrected_by_the_tests_own_errors():
    values = {"shaft_power_gain": 0.001, "own_shaft_power_gain": 0.05, "torque_offset": 0.2}
    corrections = Corrections.of(values)
    assert (corrections.shaft_power_gain, corrections.torque_offset) == (0.05, 0.2)


@pytest.mark.parametrize("wrong", [{}, {"watts": -70.0}, {"torque_Nm": 1.4}])
def test_the_losses_of_ratings_are_without_the_tests_own_errors(wrong, driven, motor):
    spoilt, right = (reduce(with_errors(driven, **w), motor) for w in (wrong, {}))
    np.testing.assert_allclose(corrected_losses(spoilt), right.inputs.losses, atol=5.0)
    loads = [float(seen_in([test]).loaded.losses) for test in (spoilt, right)]
    assert loads[0] == pytest.approx(loads[1], abs=5.0)
