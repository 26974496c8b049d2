"""A discovery fits measured bodies beside the winding: what any sensor shows counts."""

from __future__ import annotations

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from discovered import discovered
from machine_of_two_sensors import machine

from heatrun.discovery.localise import Course, Where, respond
from heatrun.discovery.run import adequacy, folds
from heatrun.effects.engine import Engine
from heatrun.model.catalogue import all_effects
from heatrun.model.model import Model
from heatrun.model.noise import from_scores
from heatrun.model.problem import Problem
from heatrun.reports.discovery_figures import missing

RIVALS = ("natural_convection", "radiation", "speed_cooling", "external_loss", "neighbour_body")
NOISE = from_scores(jnp.zeros(4))


@pytest.fixture(scope="module")
def cooled(hidden_bench):
    return machine(hidden_bench, ("natural_convection",), 940103, target_K=0.4)


@pytest.fixture(scope="module")
def bare(hidden_bench):
    """Of a machine without a hidden cause, for which no size of a cause has to be found."""
    _, motor, tests, _ = machine(hidden_bench, (), 940103)
    model = Model.of("second", motor).scaled(motor, tests)
    return Engine(Problem.of(model, motor, [model.with_bodies(test) for test in tests]))


def test_rows_of_each_sensor_are_told_apart(bare):
    first, second = bare.tests
    channels = list(bare.sensors)
    assert channels == ["winding_degC", "stator_degC"]
    rows = np.concatenate([
        np.repeat([value, 10.0 * value], test.num_blocks)
        for value, test in ((1.0, first), (1.0, second))
    ])  # fmt: skip
    for channel, value in zip(channels, (1.0, 10.0), strict=True):
        np.testing.assert_array_equal(rows[bare.sensors[channel]], value)
    assert bare.rms_K(rows) == pytest.approx(np.sqrt(1.0 + 100.0))
    rows[bare.sensors["stator_degC"]] = np.nan
    assert bare.rms_K(rows) == pytest.approx(1.0)


@pytest.mark.parametrize("event", [None, 1])
def test_what_was_read_at_one_time_is_left_out_together(bare, event):
    for mask in folds(bare, event):
        for part, test in zip(bare.problem.split(mask), bare.tests, strict=True):
            winding, stator = test.by_sensor(part)
            seen = np.logical_and(*test.by_sensor(test.is_observed))
            np.testing.assert_array_equal(winding[seen], stator[seen])


def test_heat_moves_each_sensor_as_the_model_says(bare):
    test, model = bare.tests[0], bare.problem.model
    z = np.linspace(-0.5, 0.5, len(bare.slots))
    numbers, _ = bare.values(z, 0)
    values = {name: jnp.asarray(number) for name, number in numbers.items()}
    values["stator_lag"] = jnp.asarray(40.0)
    found = respond(model, values, test, 600.0)
    # other losses enter the stator: a watt more of them is a watt there all the time
    observed = test.observation()
    watts = 5.0
    more = eqx.tree_at(lambda o: o.inputs.losses, observed, observed.inputs.losses + watts)
    change = jax.jit(lambda: model.block_means(values, more) - model.block_means(values, observed))
    expected = np.asarray(change()) / (watts * (1.0 + float(values["power_gain"])))
    by_knots = found.columns["stator"].sum(axis=1)
    for rows, right in zip(test.by_sensor(by_knots), test.by_sensor(expected), strict=True):
        np.testing.assert_allclose(rows, right, rtol=5e-3, atol=1e-6)
    assert found.rise.size == test.num_blocks


def test_an_error_of_the_winding_s_reading_is_none_of_the_body(bare):
    test, model = bare.tests[0], bare.problem.model
    values = {k: jnp.asarray(v) for k, v in bare.values(np.zeros(len(bare.slots)), 0)[0].items()}
    rows = respond(model, values, test, 600.0).columns["sensor"].sum(axis=1)
    winding, stator = test.by_sensor(rows)
    np.testing.assert_allclose(winding, 1.0)
    np.testing.assert_array_equal(stator, 0.0)


def test_what_one_sensor_shows_is_left_by_the_model(bare):
    z = np.zeros(len(bare.slots))
    present = bare.refit(z, bare.base, NOISE, most=3)
    quiet = adequacy(bare, with_residual(present, bare, 0.0))
    assert quiet.misfit_K < 0.01
    loud = adequacy(bare, with_residual(present, bare, 0.5))
    assert loud.channel == "stator_degC"
    assert loud.misfit_K == pytest.approx(0.5, rel=0.1)
    assert "of stator_degC" in loud.words
    assert loud.winding_rmse_K == pytest.approx(quiet.rmse_K, rel=1e-6)


@pytest.fixture(scope="module")
def named(cooled):
    _, motor, tests, _ = cooled
    kinds = [kind for kind in all_effects() if kind.card.id in RIVALS]
    return discovered(motor, tests, kinds=kinds)


@pytest.mark.slow
def test_a_cause_is_named_with_the_body_fitted(named):
    assert named.verdict.word == "named"
    assert named.asked.ids == ("natural_convection",)
    assert named.after.is_adequate
    fit = named.asked.fit
    names = [slot.name for slot in fit.slots]
    assert {"stator_gain", "stator_offset", "stator_lag"} <= set(names)
    assert fit.problem.tests[0].fitted == ("stator_degC",)
    # the sensor of the body is found with the rest
    for name, true in (("stator_gain", -0.015), ("stator_offset", 0.3)):
        place = names.index(name)
        parameter = fit.slots[place].parameter
        sd = parameter.sd * float(np.sqrt(fit.covariance[place, place]))
        assert float(parameter.value(fit.z[place])) == pytest.approx(true, abs=3.5 * sd)


@pytest.mark.slow
def test_the_result_says_whose_misfit_it_was(named):
    assert named.before.channel in ("winding_degC", "stator_degC")
    assert named.before.misfit_K > 0.08 > named.after.misfit_K


def with_residual(fit, engine, error_K):
    """Return a fit that leaves noise at the winding, and an error besides at the stator."""
    rng = np.random.default_rng(3)
    rows = 0.02 * rng.standard_normal(fit.residual.size)
    rows[engine.sensors["stator_degC"]] += error_K
    return replace(fit, residual=rows)


def test_heat_that_is_missing_at_any_node_is_drawn(bare):
    knots = np.linspace(0.0, bare.tests[0].duration_s, 20)
    courses = [
        Course(0, node, knots, np.ones(20), np.ones(20), np.eye(20))
        for node in ("winding", "tooth", "yoke", "sensor")
    ]
    where = Where(courses, [], {}, ("tooth",), {})
    figure = missing(bare.tests[0].winding, 0, where, where)
    colours = [axis.lines[0].get_color() for axis in figure.axes[2:6]]
    assert len(set(colours)) == 4
    assert "missing heat,\ntooth [W]" in [axis.get_ylabel() for axis in figure.axes]
