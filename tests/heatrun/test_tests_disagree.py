"""Tests between which the machine was changed: the joint fit says so and allows for it."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from heatrun.effects.small_effects import is_too_stiff
from heatrun.fit.fit import fit
from heatrun.model.model import Model
from heatrun.model.model_parameters import parameters
from heatrun.model.problem import Problem
from heatrun.posterior import fit_checks as changes
from heatrun.posterior.driven import too_stiff
from heatrun.posterior.posterior import weighted_draws
from heatrun.posterior.predict import predict
from heatrun.record.motor import ParameterOverride
from heatrun.record.record import Record
from heatrun.record.reduction import reduce
from heatrun.runs.run import ModelOfRun, model_text, read_model
from lptn.effects import EndWindingNode
from lptn.effects.heat_paths import CoolingStep

COLUMNS = {
    "t": "time_s", "Is": "phase_current_A", "Pd": "losses_W", "Te": "ambient_degC",
    "Tw_m": "winding_degC",
}  # fmt: skip
NETWORK = {"Ceq_w": 700.0, "Ceq_sr": 15000.0, "Req_w": 0.15, "Req_sr": 0.1}

MOUNTED = (1.0, 1.3, 0.8, 1.15)
"""Req_sr of each test over that of the machine; the last one is held out."""


def mounted_tests(generator, motor, factors):
    """Tests at 1 Hz; the way from stator to air is another one in each."""
    machine = generator.reference_motor()
    profiles = [f(s) for f, s in zip(
        (generator.duty, generator.staircase, generator.duty, generator.staircase),
        (3600.0, 3600.0, 4500.0, 4500.0), strict=True,
    )]  # fmt: skip
    made = []
    for index, (profile, factor) in enumerate(zip(profiles, factors, strict=True)):
        mounted = replace(machine, Req_sr=factor * machine.Req_sr)
        truth = generator.simulate(mounted, profile, sample_s=1.0, steps_per_sample=20)
        instruments = generator.Instruments(drift_sd_K=0.1, white_sd_K=0.05, resolution_K=0.1)
        read = generator.measure(truth, np.random.default_rng(70 + index), instruments)
        channels = {name: np.asarray(read[key]) for key, name in COLUMNS.items()}
        made.append(reduce(Record(f"test {index}", channels), motor))
    return made


@pytest.fixture(scope="module")
def joint(generator, motor):
    def made(factors):
        *fitted, other = mounted_tests(generator, motor, factors)
        problem = Problem.of(Model.of("second", motor), motor, fitted)
        return fit(problem), other

    return made


@pytest.fixture(scope="module")
def disagreeing(joint):
    return joint(MOUNTED)


@pytest.mark.slow
def test_tests_of_one_machine_agree(joint):
    found, _ = joint((1.0,) * 4)
    assert changes.test_to_test(found).gain < changes.CLEAR
    assert changes.fit_with_changes(found) is found


@pytest.mark.slow
def test_another_mounting_in_each_test_is_told_and_allowed_for(disagreeing, truth):
    found, _ = disagreeing
    scatter = changes.test_to_test(found)
    assert scatter.gain > changes.CLEAR
    assert 0.04 <= scatter.size <= 0.64
    again = changes.fit_with_changes(found)
    posterior = weighted_draws(again, seed=0)
    finding = changes.changes_finding(posterior)
    assert finding is not None
    assert finding.id == "tests_disagree"
    values = again.values()
    for index, factor in enumerate(MOUNTED[:3]):
        shift = np.log(values["Req_sr"] / truth["Req_sr"])
        of_test = values[f"Req_sr_change[test {index}]"] + shift
        assert abs(of_test - np.log(factor)) < 0.08
    place = [slot.name for slot in again.slots].index("Req_sr")
    sd = again.slots[place].parameter.sd * np.sqrt(again.covariance[place, place])
    assert abs(np.log(values["Req_sr"] / truth["Req_sr"])) < 3.0 * sd
    assert sd > 0.05  # three mountings with a spread of a quarter


@pytest.mark.slow
def test_the_band_of_another_test_allows_for_a_change(disagreeing):
    found, other = disagreeing
    again = changes.fit_with_changes(found)
    bands = []
    for each in (found, again):
        predicted = predict(weighted_draws(each, seed=0), other, seed=0)
        low, high = predicted.total["95"]
        bands.append((float(np.mean(high - low)), predicted.coverage_95()))
    assert bands[1][0] > bands[0][0]
    assert bands[1][1] > 0.9


def test_a_change_belongs_to_one_test_and_to_the_network_alone(blocks, motor):
    model = replace(Model.of("second", motor), change_sd=0.2)
    held = replace(motor, parameters={"Req_w": ParameterOverride(fixed=0.15)})
    known = parameters(model, held, [blocks, replace(blocks, name="other")])
    assert [slot.name for slot in known.slots if slot.parameter.role == "change"] == [
        f"{name}_change[{test}]"
        for test in ("duty", "other")
        for name in ("Ceq_w", "Ceq_sr", "Req_sr")
    ]
    values = NETWORK
    changed = model.network({**values, "Req_sr_change": np.log(1.5)})
    assert float(changed.resistance["stator", "ambient"]) == pytest.approx(0.15)
    assert float(changed.resistance["winding", "stator"]) == pytest.approx(0.15)
    assert float(model.network(values).resistance["stator", "ambient"]) == pytest.approx(0.1)
    assert model.in_general({**values, "Req_sr_change": 0.4}) == values
    again = read_model(model_text(ModelOfRun(model, known)), "model.toml")
    assert again == ModelOfRun(model, known)


def test_a_change_may_make_a_node_too_fast_for_the_steps(motor):
    model = replace(Model.of("second", motor), change_sd=0.2)
    values = {name: np.full(2, value) for name, value in NETWORK.items()}
    changes = {"Req_w_change": np.array([0.0, -8.0])}
    assert too_stiff(model, values | changes, 5.0).tolist() == [False, True]
    assert not np.any(too_stiff(model, values, 5.0))


def test_an_effect_may_make_a_node_too_fast_for_the_steps(blocks, motor):
    """Of an overhang that is nearly the whole winding the rest of it is next to nothing."""
    model = Model.of("second", motor, (EndWindingNode, CoolingStep))
    tests = [blocks, replace(blocks, name="other")]  # the step is an event of each test
    problem = Problem.of(model, motor, tests)
    z = np.zeros((2, problem.parameters.num_free))
    place = problem.parameters.index("end_winding_node.f")
    z[1, place] = problem.parameters.slots[place].parameter.score(0.99)
    posterior = SimpleNamespace(fit=SimpleNamespace(problem=problem))
    assert is_too_stiff(posterior, z).tolist() == [False, True]
