"""Default priors follow the scale of the machine: from 1 W to 1 MW, and a conflict is told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from heatrun.fit.fit import fit
from heatrun.model.model import Model
from heatrun.model.problem import Problem
from heatrun.model.scale import one_node, scale_of_tests
from heatrun.posterior.fit_checks import fit_findings
from heatrun.posterior.posterior import weighted_draws
from heatrun.record.motor import ParameterOverride
from heatrun.record.record import Record
from heatrun.record.reduction import reduce

NETWORK = {"Ceq_w": 1, "Ceq_sr": 1, "Req_w": -1, "Req_sr": -1}
"""Power of the size that each parameter grows with."""


def sized(duty, motor, size):
    """The record of a machine with `size` times the losses and capacities at the same course."""
    channels = {**duty.channels, "losses_W": size * duty["losses_W"]}
    record = Record("sized", channels)
    machine = replace(motor, phase_resistance_ohm=size * motor.phase_resistance_ohm)
    return machine, reduce(record, machine)


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])  # reference: 1 kW of losses
def test_the_fit_is_the_same_at_every_size(duty, motor, truth, size):
    machine, test = sized(duty, motor, size)
    model = Model.of("second", machine).scaled(machine, [test])
    found = fit(Problem.of(model, machine, [test]))
    for name, power in NETWORK.items():
        place = found.problem.parameters.index(name)
        parameter = found.slots[place].parameter
        true = truth[name] * size**power
        sd = float(np.sqrt(found.covariance[place, place]))
        assert abs(found.z[place] - parameter.score(true)) < 3.0 * sd, name
        low, high = parameter.prior_interval_95()
        assert low < true < high, name


def test_what_the_user_states_is_left(duty, motor):
    machine, test = sized(duty, motor, 1e3)
    stated = replace(machine, parameters={"Ceq_sr": ParameterOverride(value=2e4, relative_sd=0.1)})
    model = Model.of("second", stated).scaled(stated, [test])
    by_name = {s.name: s.parameter for s in Problem.of(model, stated, [test]).parameters.slots}
    assert by_name["Ceq_sr"].centre == 2e4
    assert by_name["Ceq_w"].centre > 1e5


def test_a_prior_that_the_tests_contradict_is_a_finding_with_both(duty, motor):
    machine, test = sized(duty, motor, 1.0)
    stated = replace(
        machine, parameters={"Ceq_w": ParameterOverride(value=3000.0, relative_sd=0.3)}
    )
    found = fit(Problem.of(Model.of("second", stated), stated, [test]))
    (finding,) = [
        each for each in fit_findings(weighted_draws(found), []) if each.id == "prior_conflict"
    ]
    assert "Ceq_w" in finding.message
    assert "stated in the motor file" in finding.message
    assert finding.values["prior_sd"] < -2.0


def test_a_test_without_heat_has_no_scale(duty, motor):
    cold = Record("cold", {**duty.channels, "winding_degC": duty["ambient_degC"]})
    assert scale_of_tests([reduce(cold, motor)]) is None


def test_a_test_that_starts_warm_does_not_hide_how_fast_the_winding_is(motor):
    """Forty minutes near the end of a heat run, then an hour of cooling: 1 K/min at 400 W."""
    C_w, C_sr, R_w, R_sr, ambient = 900.0, 11_000.0, 0.08, 0.13, 22.0
    time = np.arange(0.0, 6000.0, 2.0)
    losses = np.where(time < 2400.0, 400.0, 0.0)
    winding, stator, read = ambient + 400.0 * (R_w + R_sr) - 6.0, ambient + 400.0 * R_sr - 6.0, []
    for watts in losses:
        read.append(winding)
        to_stator = (winding - stator) / R_w
        winding += 2.0 * (0.6 * watts - to_stator) / C_w
        stator += 2.0 * (0.4 * watts + to_stator - (stator - ambient) / R_sr) / C_sr
    channels = {
        "time_s": time, "phase_current_A": np.sqrt(losses), "losses_W": losses,
        "ambient_degC": np.full(time.size, ambient), "winding_degC": np.array(read),
    }  # fmt: skip
    test = reduce(Record("warm", channels), motor)
    model = Model.of("second", motor).scaled(motor, [test])
    priors = {s.name: s.parameter for s in Problem.of(model, motor, [test]).parameters.slots}
    for name, true in {"Ceq_w": C_w, "Ceq_sr": C_sr, "Req_w": R_w, "Req_sr": R_sr}.items():
        low, high = priors[name].prior_interval_95()
        assert low < true < high, name


def test_pulses_of_the_winding_do_not_hide_the_body(motor):
    """An S3 duty of 10 min: the winding swings, and the machine behind it is ten times as large."""
    time = np.arange(0.0, 4500.0, 2.0)
    watts = np.where((time % 600.0 < 300.0) & (time < 3600.0), 170.0, 0.0)
    degC = np.full((2, time.size), 20.0)
    for now in range(time.size - 1):
        winding, body = degC[:, now]
        across, lost = (winding - body) / 0.52, (body - 20.0) / 0.5
        heat = np.array([0.65 * watts[now] - across, 0.35 * watts[now] + across - lost])
        degC[:, now + 1] = degC[:, now] + 2.0 * heat / np.array([126.0, 1286.0])
    channels = {"time_s": time, "phase_current_A": 0.02 * np.sqrt(watts), "losses_W": watts,
                "winding_degC": degC[0], "ambient_degC": np.full(time.size, 20.0)}  # fmt: skip
    found = one_node([reduce(Record("pulses", channels), motor)])
    assert found is not None
    capacity, resistance = found
    assert 1412.0 / 3.0 < capacity < 1.5 * 1412.0
    assert 0.4 < resistance < 1.1


def test_the_resistance_of_a_coil_is_open_to_eddies_unless_stated(duty, motor):
    """One phase: of how much more alternating current meets, no channel tells."""
    stated = {"Rs0": ParameterOverride(value=motor.phase_resistance_ohm, relative_sd=0.01)}
    for machine, sd in (
        (motor, 0.01),
        (replace(motor, phases=1), 0.07),
        (replace(motor, phases=1, parameters=stated), 0.01),
    ):
        slots = Problem.of(Model.of("second", machine), machine, [reduce(duty, machine)])
        (prior,) = [s.parameter for s in slots.parameters.slots if s.name == "Rs0"]
        assert prior.sd == pytest.approx(sd, rel=0.01)
