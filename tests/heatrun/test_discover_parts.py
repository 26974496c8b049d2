"""The stages of discovery, each alone; measured bodies beside the winding count."""

from dataclasses import replace
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from discovered import discovered
from hidden_machines import machine
from measured_machine import measured_record

from heatrun.discovery.discovery import adequacy, folds, left_out_errors, rmse
from heatrun.discovery.localise import Course, Where, respond
from heatrun.effects.engine import Engine, library, placed, white
from heatrun.effects.found import with_catalogue
from heatrun.errors import InputError
from heatrun.fit.fit import fit
from heatrun.io.texts import Texts
from heatrun.model.catalogue import all_effects
from heatrun.model.model import Model
from heatrun.model.noise import from_scores
from heatrun.model.problem import Problem
from heatrun.record.motor import Adequacy
from heatrun.record.reduction import reduce
from heatrun.reports.discovery import missing, parameter_row
from heatrun.results.discovery import ParameterBeforeAfter, ValueWithInterval
from lptn import EFFECTS, second_order

MINE = Path(__file__).with_name("cabinet_heater.py")
USER_EFFECT = MINE.read_text()


@pytest.fixture(scope="module")
def engine(blocks, motor):
    found = library(EFFECTS, second_order(1.0, 1.0, 1.0, 1.0), [blocks])
    return Engine(Problem.of(Model.of("second", motor, found.kinds), motor, [blocks], found.kinds))


@pytest.fixture(scope="module")
def base(engine):
    return engine.refit(np.zeros(len(engine.slots)), engine.base, white(0.3))


def test_all_effects_at_their_null_are_the_base_model(engine, base, fitted):
    names = [slot.name for slot in engine.slots]
    z = np.zeros(len(engine.slots))
    for position, slot in enumerate(fitted.slots):
        z[names.index(slot.name)] = fitted.z[position]
    columns = [names.index(slot.name) for slot in fitted.slots]
    residual, jacobian = engine.linearise(z, columns)
    problem = fitted.problem
    expected, slopes = problem.linearised(fitted.z)
    # general against affine step: both third order, equal to rounding; nulls within 1e-8 K
    np.testing.assert_allclose(residual, expected, atol=1e-7)
    np.testing.assert_allclose(jacobian, slopes, atol=1e-6)


def test_parts_left_out_of_a_single_test_are_predicted(engine, base):
    masks = folds(engine)
    assert len(masks) == 4
    errors = left_out_errors(engine, base, masks)
    assert np.all(np.isfinite(errors[engine.is_observed]))
    inside = rmse(base.residual[engine.is_observed])
    assert inside < rmse(errors) < 4.0 * inside


def test_effects_without_their_channel_are_said_to_be_unavailable(blocks):
    found = library(EFFECTS, second_order(1.0, 1.0, 1.0, 1.0), [blocks])
    assert "coolant_degC" in found.unavailable["coolant_sink"]
    assert "fan" in found.unavailable["fan_cooling"]
    events = [c for c in found.candidates if c.id == "cooling_step"]
    assert [c.test for c in events] == [0]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("x = 1\n", "no effect"),
        ("raise OSError('no')\n", "does not run"),
        (USER_EFFECT.replace("cabinet_heater", "radiation"), "taken"),
        (USER_EFFECT.replace('Quantity("W", 0.0', 'Quantity("W", None'), "null value"),
    ],
)
def test_a_users_file_that_cannot_be_used_is_refused(tmp_path, text, said):
    path = tmp_path / "mine.py"
    path.write_text(text)
    with pytest.raises(InputError, match=said):
        all_effects([path])
    with pytest.raises(InputError, match="not there"):
        all_effects([tmp_path / "nowhere.py"])


def test_an_effect_of_an_installed_package_is_taken_in(monkeypatch):
    (kind,) = [k for k in all_effects([MINE]) if k.card.id == "cabinet_heater"]

    class Entry:
        name = "cabinet"

        def load(self):
            return kind

    monkeypatch.setattr("heatrun.model.catalogue.entry_points", lambda group: [Entry()])
    assert all_effects()[-1] is kind


def test_what_a_held_out_test_lacks_is_not_searched(blocks):
    silent = replace(blocks, means={k: v for k, v in blocks.means.items() if k != "speed"})
    network = second_order(1.0, 1.0, 1.0, 1.0)
    found = library(EFFECTS, network, [blocks, silent], num_events=1)
    assert "speed_rpm" in found.unavailable["speed_cooling"]
    assert [c.test for c in found.candidates if c.id == "cooling_step"] == [0]


RIVALS = ("natural_convection", "radiation", "speed_cooling", "external_loss", "neighbour_body")
NOISE = from_scores(jnp.zeros(4))


@pytest.fixture(scope="module")
def cooled(hidden_bench):
    return machine(hidden_bench, ("natural_convection",), 940103, stator=True, target_K=0.4)


@pytest.fixture(scope="module")
def bare(hidden_bench):
    """Of a machine without a hidden cause, for which no size of a cause has to be found."""
    _, motor, tests, _ = machine(hidden_bench, (), 940103, stator=True)
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
    figure = missing(bare.tests[0].winding, 0, where, where, Texts("de"))
    colours = [axis.lines[0].get_color() for axis in figure.axes[2:6]]
    assert len(set(colours)) == 4
    assert "fehlende Wärme,\nZähne [W]" in [axis.get_ylabel() for axis in figure.axes]


@pytest.mark.parametrize(
    ("wrong_by", "printed"),
    [(-0.0002, "0.0 %"), (0.0003, "0.0 %"), (-0.354, "-35.4 %"), (0.246, "+24.6 %"), (None, "–")],
)
def test_a_nought_has_no_sign(wrong_by, printed):
    figure = ValueWithInterval(value=0.02701, interval_95=(0.0265, 0.0275))
    entry = ParameterBeforeAfter(before=figure, after=figure, unit="ohm", wrong_by=wrong_by)
    assert parameter_row("Rs0", entry)[-1] == printed


@pytest.mark.slow
def test_an_instrument_far_beyond_its_prior_is_refitted_where_it_is(generator, motor):
    """Held at 8 standard deviations, a stator sensor that sits on the housing left 4 K of misfit to
    the search, which named an effect for it."""
    record = measured_record(generator, generator.duty(3600.0), 71)
    sink = record.channels["ambient_degC"]
    cool = sink + 0.6 * (record.channels["stator_degC"] - sink)
    record = replace(record, channels={**record.channels, "stator_degC": cool})
    # with next to no unmodelled heat, or that takes the blame
    model = Model.of("second", replace(motor, adequacy=Adequacy(unmodelled_heat=1e-4)))
    found = fit(Problem.of(model, motor, [model.with_bodies(reduce(record, motor))]))
    gain = found.problem.parameters.index("stator_gain")
    assert found.z[gain] < -10.0

    tests = found.problem.tests
    usable, extended = with_catalogue(model, motor, tests, all_effects())
    engine = Engine(Problem.of(extended, motor, tests, searched=usable.kinds))
    z, order = placed(engine, found)
    engine = engine.with_noise_of(found.problem)
    again = engine.refit(z, order, found.noise)
    assert again.z[order[gain]] < -10.0
    before, after = (np.sqrt(np.mean(rows**2))
                     for rows in (np.concatenate(found.residual), again.residual))  # fmt: skip
    assert after < 1.1 * before
