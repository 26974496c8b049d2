"""Masses in the motor file say what a short test does not: the capacities."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from heatrun.errors import InputError
from heatrun.fit.fit import fit
from heatrun.model.model import Model
from heatrun.model.problem import Problem
from heatrun.model.scale import BODY, TAKING_PART
from heatrun.motor.file import parse_motor
from heatrun.posterior.fit_checks import fit_findings
from heatrun.posterior.posterior import weighted_draws
from heatrun.record.motor import ParameterOverride
from heatrun.record.record import Record
from heatrun.record.reduction import reduce


def fitted_with(motor, test, **masses):
    machine = replace(motor, **masses)
    model = Model.of("second", machine).scaled(machine, [test])
    return fit(Problem.of(model, machine, [test]))


def spread(found, name):
    place = found.problem.parameters.index(name)
    parameter = found.slots[place].parameter
    return parameter, found.z[place], parameter.sd * np.sqrt(found.covariance[place, place])


@pytest.fixture(scope="module")
def short(duty, motor):
    first = {name: values[duty["time_s"] < 150.0] for name, values in duty.channels.items()}
    return reduce(Record("short", first), motor)


def test_a_short_test_is_helped_by_the_mass(short, motor, truth):
    mass = truth["Ceq_sr"] / (TAKING_PART * BODY) * 1.3  # the machine is not as is assumed
    _, _, alone = spread(fitted_with(motor, short), "Ceq_sr")
    parameter, score, helped = spread(fitted_with(motor, short, mass_kg=mass), "Ceq_sr")
    assert helped < 0.6 * alone
    gap = np.log(truth["Ceq_sr"]) - np.log(parameter.centre) - parameter.sd * score
    assert abs(gap) < 2.5 * helped
    assert f"kg at {BODY:g} J/(kg K)" in parameter.basis


def test_a_mass_that_the_test_contradicts_is_a_finding(duty, motor, truth):
    """Pounds, or the mass of the whole drive."""
    found = fitted_with(motor, reduce(duty, motor), mass_kg=8.0 * truth["Ceq_sr"] / BODY)
    findings = [f for f in fit_findings(weighted_draws(found), []) if f.id == "prior_conflict"]
    assert [f for f in findings if "Ceq_sr" in f.message and "J/(kg K)" in f.message]


def priors(order, machine, test):
    model = Model.of(order, machine).scaled(machine, [test])
    slots = Problem.of(model, machine, [test]).parameters.slots
    return {slot.name: slot.parameter for slot in slots}


def test_each_mass_goes_to_its_nodes(short, motor):
    machine = replace(motor, mass_kg=10.0, conductor_mass_kg=2.0)
    second, four = priors("second", machine, short), priors("four", machine, short)
    assert second["Ceq_w"].centre == pytest.approx(1.15 * 385.0 * 2.0)
    assert second["Ceq_sr"].centre == pytest.approx(0.85 * 460.0 * 8.0)
    assert four["Ceq_tooth"].centre == pytest.approx(0.85 * 460.0 * 8.0 / 3.0)
    assert four["Ceq_tooth"].sd > second["Ceq_sr"].sd  # of several the sum is known
    assert "the winding changes by" in priors("first", machine, short)["Ceq"].basis
    aluminium = replace(machine, resistance_coefficient_degC=225.0)
    assert priors("second", aluminium, short)["Ceq_w"].centre == pytest.approx(1.15 * 897.0 * 2.0)
    stated = replace(
        machine, parameters={"Ceq_sr": ParameterOverride(value=900.0, relative_sd=0.1)}
    )
    assert priors("second", stated, short)["Ceq_sr"].centre == 900.0


def test_masses_are_read_and_judged():
    text = '[motor]\nname = "m"\nmass_kg = 12\n[winding]\nconductor_mass_kg = {}\n'
    motor = parse_motor(text.format(1.5).encode(), "motor.toml")
    assert (motor.mass_kg, motor.conductor_mass_kg) == (12.0, 1.5)
    with pytest.raises(InputError, match="conductor_mass_kg below mass_kg, got 15 of 12 kg"):
        parse_motor(text.format(15).encode(), "motor.toml")
    with pytest.raises(InputError, match="above 0"):
        parse_motor(text.format(0).encode(), "motor.toml")
