"""The error of the mechanical power is no share of the losses: it changes sign with the load."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from measured_machine import measured_record

from heatrun.fit.fit import fit
from heatrun.model.bodies import shaft_errors
from heatrun.model.model import Model
from heatrun.model.problem import Problem
from heatrun.posterior.posterior import normal_draws
from heatrun.posterior.predict import predict
from heatrun.posterior.virtual import virtual_record
from heatrun.record.reduction import reduce

GAIN = 0.015
NETWORK = ("Ceq_w", "Ceq_sr", "Req_w", "Req_sr")


@pytest.fixture(scope="module")
def record(generator):
    """A staircase as a motor, and after it as a generator."""
    up = generator.staircase(3600.0)
    down = [replace(segment, torque=-segment.torque) for segment in up.segments]
    profile = generator.Profile((*up.segments, *down))
    return measured_record(generator, profile, 81, stator=False, shaft_gain=GAIN)


def fitted(record, motor):
    return fit(Problem.of(Model.of("second", motor), motor, [reduce(record, motor)]))


def test_the_gain_is_found_and_the_parameters_are_right(record, motor, truth):
    found = fitted(record, motor)
    values, sd = found.values(), np.sqrt(np.diag(found.covariance))
    place = found.problem.parameters.index("shaft_power_gain")
    assert abs(values["shaft_power_gain"] - GAIN) < 3.0 * 0.01 * sd[place]
    assert sd[place] < 0.3  # of the prior
    for name in NETWORK:
        place = found.problem.parameters.index(name)
        off = found.z[place] - found.slots[place].parameter.score(truth[name])
        assert abs(off) < 3.0 * sd[place], name


def test_without_the_torque_the_same_error_is_not_explained(record, motor, truth):
    channels = {name: v for name, v in record.channels.items() if name != "torque_Nm"}
    blind, seeing = fitted(replace(record, channels=channels), motor), fitted(record, motor)
    assert "shaft_power_gain" not in blind.problem.parameters.names
    assert float(blind.noise.heat) > 3.0 * float(seeing.noise.heat)


def test_a_map_of_losses_knows_no_mechanical_power(record, motor):
    model = Model.of("second", replace(motor, losses="map"))
    names = Problem.of(model, replace(motor, losses="map"), [reduce(record, motor)]).parameters
    assert "shaft_power_gain" not in names.names


def test_a_wrong_zero_of_the_torque_puts_nothing_in_at_standstill(record, motor):
    """Where the speed is told; else the offset is of the power itself."""
    test = reduce(record, motor)
    (of_torque,) = (each for each in shaft_errors(motor, [test]) if "offset" in each.name)
    assert of_torque.name == "torque_offset"
    power, speed = (np.abs(v) for v in (test.inputs.shaft_power, test.inputs.speed))
    assert of_torque.sd * np.max(speed) == pytest.approx(1e-3 * np.max(power))
    still = replace(test.inputs, speed=None)
    (of_power,) = (e for e in shaft_errors(motor, [replace(test, inputs=still)]) if e.unit == "W")
    assert of_power.name == "shaft_power_offset"


def test_a_test_that_tells_no_speed_is_predicted_without_the_zero_of_the_torque(record, motor):
    found = normal_draws(fitted(record, motor))
    assert "torque_offset" in found.values()
    channels = {n: v for n, v in record.channels.items() if n not in ("speed_rpm", "torque_Nm")}
    silent = replace(record, channels=channels, name="silent")
    prediction = predict(found, reduce(silent, motor))
    assert "torque_offset" not in prediction.values
    assert np.all(np.isfinite(virtual_record(prediction, silent, motor)["winding_degC"]))
