"""What `calibrate` says of a network that misses something, and draws with effects behind them."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from bench_package import write_motor
from hidden_machines import machine
from scipy.integrate import quad
from scipy.stats import norm

import heatrun
from heatrun.effects.search import ODDS
from heatrun.effects.small_effects import (
    SCALES,
    SmallEffects,
    _log_bayes,
    draw_sizes,
    missing_finding,
    small_effects,
)
from heatrun.model.catalogue import all_effects
from heatrun.model.draws import Draws, PlausibleEffect, PlausibleEffects, courses
from heatrun.model.model import Model
from heatrun.model.model_parameters import parameters
from heatrun.posterior.driven import virtual_record
from heatrun.posterior.predict import predict
from lptn.effects import EFFECTS


@pytest.fixture(scope="module")
def calibrated(hidden_bench, tmp_path_factory):
    """Calibrate a machine with a hidden cause of 0.12 K; return the run and its case."""

    def calibrate(hidden, seed):
        case = hidden_bench.make_case(hidden, seed, target_K=0.12, resolution_K=0.1)
        folder = tmp_path_factory.mktemp("missing")
        write_motor(case, folder)
        paths = {}
        for test, name in ((case.tests[0], "stairs"), (case.tests[2], "other")):
            paths[name] = folder / f"{name}.csv"
            table = pd.DataFrame(test.columns).iloc[::4]  # a logger with 2 s
            table.to_csv(paths[name], index=False, float_format="%.6g")
        run = heatrun.calibrate(
            folder / "motor.toml", paths["stairs"], holdout=paths["other"], model="second",
            method="quick", out=folder / "run",
        )  # fmt: skip
        return run, case

    return calibrate


@pytest.fixture(scope="module")
def clean(fitted):
    """The fit of a clean record, and what it may miss."""
    return fitted, small_effects(fitted)


def line(*, num_effects=1):
    """Return a line with a parameter and effects, and the likelihood of the effects' sizes.

    The parameter is integrated out, with its standard normal prior.
    """
    rng = np.random.default_rng(3)
    by_score, *by_size = rng.normal(size=(1 + num_effects, 12))
    rows = 0.7 * by_score + 0.5 * by_size[0] + rng.normal(size=12)
    covariance = np.eye(12) + np.outer(by_score, by_score)

    def likelihood(*sizes):
        moved = rows + sum(size * by for size, by in zip(sizes, by_size, strict=True))
        return np.exp(-0.5 * moved @ np.linalg.solve(covariance, moved))

    at = np.array([0.4])  # a fit that stands somewhere
    joined = np.column_stack([rows + at[0] * by_score, by_score, *by_size])
    return joined, at, likelihood


@pytest.mark.parametrize("one_sign", [True, False])
def test_the_evidence_of_a_small_effect_is_that_of_its_law(one_sign):
    """A line with a parameter and an effect, by numerical integration over the effect's size."""
    joined, at, likelihood = line()

    def integrated(scale):
        low, folded = (0.0, 2.0) if one_sign else (-np.inf, 1.0)
        return quad(lambda s: folded * norm.pdf(s, scale=scale) * likelihood(s), low, np.inf)[0]

    (log_bayes,) = _log_bayes(joined, at, np.array([one_sign]))
    expected = np.mean([integrated(scale) for scale in SCALES]) / likelihood(0.0)
    assert log_bayes == pytest.approx(np.log(expected), abs=1e-6)


def test_the_draws_of_two_small_effects_have_their_law():
    """Against the sum over which are there and the numerical integral over their sizes."""
    joined, at, likelihood = line(num_effects=2)
    size, moved = draw_sizes(joined, at, np.array([True, False]), least_of_none=0.0, seed=4)
    first, second = np.linspace(0.0, 3.5, 141), np.linspace(-3.5, 3.5, 281)
    grid = np.array([[likelihood(a, b) for b in second] for a in first])
    slab = [
        np.mean([fold * norm.pdf(sizes, scale=scale) for scale in SCALES], axis=0)
        * np.gradient(sizes)
        for fold, sizes in ((2.0, first), (1.0, second))
    ]
    slab[0][0] *= 0.5  # a trapezium's end
    of_none = likelihood(0.0, 0.0)
    of_first = ODDS * slab[0] @ grid[:, second.size // 2]
    of_second = ODDS * grid[0] @ slab[1]
    of_both = ODDS**2 * slab[0] @ grid @ slab[1]
    total = of_none + of_first + of_second + of_both
    assert np.mean(~np.any(size, axis=1)) == pytest.approx(of_none / total, abs=0.03)
    assert np.mean(size[:, 0] != 0) == pytest.approx((of_first + of_both) / total, abs=0.03)
    assert np.mean(size[:, 1] != 0) == pytest.approx((of_second + of_both) / total, abs=0.03)
    by_first = ODDS * (slab[0] * first) @ (grid[:, second.size // 2] + ODDS * grid @ slab[1])
    assert np.mean(size[:, 0]) == pytest.approx(by_first / total, abs=0.02)
    assert np.all(size[:, 0] >= 0.0)
    across = joined[:, 1] @ joined[:, 1:]
    np.testing.assert_allclose(moved[0], -across[1:] / (across[0] + 1.0))


def test_a_large_effect_that_the_parameters_mimic_leaves_no_rounding_for_evidence():
    """Means over minutes and many kilowatts: its products held nothing else."""
    joined, at, _ = line()
    mimicked = np.column_stack([joined, 1e9 * joined[:, 1] + 1e-3 * joined[:, 2]])
    (alone, beside) = _log_bayes(mimicked, at, np.array([False, False]))
    assert alone == pytest.approx(_log_bayes(joined, at, np.array([False]))[0])
    assert beside < -10.0  # of such a size, the prior on the parameter forbids it
    size, _ = draw_sizes(mimicked, at, np.array([False, False]))
    assert np.all(np.isfinite(size))


def test_no_effect_to_be_weighed_is_none_that_is_missing(clean):
    fitted, _ = clean
    gain = next(kind for kind in all_effects() if kind.card.id == "loss_gain")
    found = small_effects(fitted, [gain])  # an error of an instrument, which every network has
    assert found is not None
    assert found.effects == ()
    assert not found.is_seen
    assert [each.candidate.id for each in found.sights] == ["loss_gain"]


def test_at_least_half_of_the_draws_are_of_the_network_alone():
    joined, at, _ = line(num_effects=2)
    joined[:, 0] += 9.0 * joined[:, 2:].sum(axis=1)  # so loud that both are there
    size, _ = draw_sizes(joined, at, np.array([False, False]))
    assert np.mean(~np.any(size, axis=1)) == pytest.approx(0.5, abs=0.03)


def test_of_a_clean_record_nothing_is_seen(clean):
    _, found = clean
    assert found.p > 0.02  # the duty is clean; the seed of its noise was not chosen for this
    assert not found.is_seen
    assert found.probability_of_none >= 0.5
    sights = {each.candidate.id: each for each in found.sights}
    # a gain of the losses is taken up by C and R; a lag of the sensor by nothing
    assert not sights["loss_gain"].is_visible
    assert sights["sensor_lag"].is_visible


def test_a_resistance_stands_for_its_mean_over_the_tests(clean):
    """An effect of next to nothing once moved it by 15 %, for its size was that of another fit."""
    fitted, found = clean
    sd = np.sqrt(np.diag(fitted.covariance)[: fitted.z.size])
    apart = found.turn * np.std(found.size, axis=0) / sd[:, None]
    assert np.max(np.abs(apart)) < 3.0
    names = [slot.parameter.name for slot in fitted.slots]
    scaled = [
        (each.id, name)
        for each in found.effects
        for name in names
        if name in each.without and each.without[name] != each.with_effect[name]
    ]
    assert ("speed_cooling", "Req_sr") in scaled
    assert {name for _, name in scaled} <= {"Req_w", "Req_sr"}


def of_kind(run, name):
    return [finding for finding in run.result.findings if finding.id == name]


def of_friction(fitted, probability, shift=0.0):
    """Return the finding that bearing friction may be missing, which moves the first parameter."""
    kind = next(kind for kind in all_effects() if kind.card.id == "bearing_friction")
    turn = np.zeros((fitted.z.size, 1))
    turn[0] = shift * np.sqrt(fitted.covariance[0, 0])
    size = (np.arange(100) < round(100 * probability)).astype(float)[:, None]
    effect = PlausibleEffect(kind, None, probability, {}, {})
    finding = missing_finding(fitted, SmallEffects(0.004, (3.0,), (effect,), size, turn))
    assert finding is not None
    assert f"bearing_friction ({100 * probability:.0f} %)" in finding.message
    assert finding.values["probability_of_none"] == pytest.approx(1.0 - probability)
    return finding


def test_what_is_not_decided_is_a_note(fitted):
    """What is decided is in the network by now; the intervals allow for the rest."""
    finding = of_friction(fitted, 0.45)
    assert finding.severity == "note"
    assert "too little for a name" in finding.message
    assert "no parameter of the network would move" in finding.message
    moved = of_friction(fitted, 0.45, shift=-1.5)
    assert moved.severity == "note"
    assert fitted.slots[0].name in moved.message
    assert moved.values[f"change_of_{fitted.slots[0].name}"] != 0.0


@pytest.mark.slow
def test_an_effect_too_small_to_see_is_in_the_model_and_the_intervals_hold_the_truth(calibrated):
    run, case = calibrated(("external_loss",), 7)
    model = run.result.models["second"]
    # the network alone leaves 0.18 K, and would put a parameter far off
    assert next(row for row in model.residuals if row.role == "calibration").rmse_K < 0.15
    assert run.result.effects == ("external_loss",)
    assert not of_kind(run, "missing_effect")
    for name in ("Ceq_w", "Ceq_sr", "Req_w", "Req_sr"):
        entry = model.parameters[name]
        assert entry.interval_95[0] < getattr(case.machine, name) < entry.interval_95[1], name


@pytest.mark.slow
def test_a_run_read_back_predicts_with_the_effects_that_it_may_miss(calibrated):
    run, _ = calibrated(("external_loss",), 7)
    course = run.courses()[1]
    again = run.predict(run.source(run.tests[1]))
    np.testing.assert_allclose(again.median, course["second_winding_degC"], atol=0.05)
    draws = run.draws()
    rows = run.result.models["second"].maybe_missing
    np.testing.assert_allclose(
        np.mean(draws.plausible.size != 0.0, axis=0), [row.probability for row in rows], atol=0.05
    )
    assert 0.3 < np.mean(draws.plausible.is_none) < 1.0


@pytest.mark.slow
def test_of_a_machine_that_is_what_it_seems_nothing_is_told(calibrated):
    run, _ = calibrated((), 8)
    for name in ("missing_effect", "holdout_outside_band", "instrument_beyond_prior"):
        assert not of_kind(run, name)


RECIRCULATION = next(each for each in EFFECTS if each.card.id == "ambient_recirculation")
NUM_DRAWS = 40


@pytest.fixture(scope="module")
def two_sensors(hidden_bench):
    _, motor, tests, _ = machine(hidden_bench, (), 940211, stator=True)
    return motor, tests


def draws_of(model, motor, tests, plausible=None):
    """Draws that are all at the most probable values."""
    rows = [model.with_bodies(test) for test in tests]
    found = parameters(model, motor, rows)
    vectors = np.zeros((NUM_DRAWS, found.num_free + 4))
    return Draws(model, motor, found, vectors, plausible)


def centre_of(model, motor, tests):
    """The most probable values of what is the same in all tests."""
    known = parameters(model, motor, [model.with_bodies(test) for test in tests]).by_test[0]
    return {name: p.centre for name, p in known.items() if not p.per_test}


def test_winding_nodes_flows_and_bodies_are_those_of_the_network_with_the_effect(two_sensors):
    motor, tests = two_sensors
    alone = Model.of("second", motor).scaled(motor, tests)
    named = "ambient_recirculation.r"
    extended = replace(alone, effects=(RECIRCULATION,))
    of_effect = draws_of(extended, motor, tests)
    with_effect = {n: float(np.median(v)) for n, v in of_effect.of_test(tests[0].name).items()}
    with_effect[named] = 0.02
    effect = PlausibleEffect(RECIRCULATION, None, 0.5, with_effect, {**with_effect, named: 0.0})
    plausible = PlausibleEffects((effect,), np.ones((NUM_DRAWS, 1)))
    found = predict(draws_of(alone, motor, tests, plausible), tests[0], fitted_as=tests[0].name)
    slot = [s.parameter.name for s in of_effect.parameters.slots].index(named)
    parameter = of_effect.parameters.slots[slot].parameter
    vectors = of_effect.vectors.copy()
    vectors[:, slot] = parameter.score(0.02)
    held = replace(of_effect, vectors=vectors)
    expected = predict(held, tests[0], fitted_as=tests[0].name)
    bare = predict(draws_of(alone, motor, tests), tests[0], fitted_as=tests[0].name)
    assert np.max(expected.median - bare.median) > 1.0  # the effect matters
    np.testing.assert_allclose(found.median, expected.median, atol=1e-6)
    for node, course in expected.nodes.items():
        np.testing.assert_allclose(found.nodes[node], course, atol=1e-6, err_msg=node)
    for link, course in expected.flows.items():
        np.testing.assert_allclose(found.flows[link], course, atol=1e-4, err_msg=str(link))
    (body,), (of_body,) = found.bodies, expected.bodies
    assert body.is_fitted
    np.testing.assert_allclose(body.median, of_body.median, atol=1e-6)
    record = SimpleNamespace(duration_s=float(tests[0].time[-1]))
    rows, of_effect, of_bare = (
        virtual_record(each, record, motor)  # pyright: ignore[reportArgumentType]
        for each in (found, expected, bare)
    )
    for name in rows.columns:
        change = np.sqrt(np.mean((of_effect[name] - of_bare[name]) ** 2))
        apart = np.sqrt(np.mean((rows[name] - of_effect[name]) ** 2))
        # between the middles of blocks along lines, where the flow steps with the load
        assert apart <= (0.15 if name.startswith("flow") else 0.01) * change + 1e-9, name


def test_a_body_in_a_link_leaves_the_flow_out_of_its_first_node(two_sensors):
    """The case between stator and sink, and the end winding between winding and stator."""
    motor, tests = two_sensors
    alone = Model.of("second", motor).scaled(motor, tests)
    rows = [alone.with_bodies(test) for test in tests[:1]]
    kinds = [kind for kind in EFFECTS if kind.card.id in ("housing_node", "end_winding_node")]
    extended = replace(alone, effects=tuple(kinds))
    known = parameters(extended, motor, rows, searched=kinds).by_test[0]
    centre = {name: p.centre for name, p in known.items() if not p.per_test}
    effects = []
    for kind in kinds:
        own = {
            f"{kind.card.id}.{name}": quantity.typical
            for name, quantity in kind.card.parameters.items()
            if quantity.null is not None
        }
        effects.append(PlausibleEffect(kind, None, 0.5, {**centre, **own}, centre))
    for index, effect in enumerate(effects):
        size = np.zeros((NUM_DRAWS, len(effects)))
        size[:, index] = 1.0
        plausible = PlausibleEffects(tuple(effects), size)
        found = predict(draws_of(alone, motor, tests, plausible), tests[0], fitted_as=tests[0].name)
        bare = predict(draws_of(alone, motor, tests), tests[0], fitted_as=tests[0].name)
        assert set(found.flows) == set(bare.flows)
        stored = found.flows["stator", "ambient"] - bare.flows["stator", "ambient"]
        assert np.all(np.isfinite(stored)), effect.id
        assert np.max(np.abs(stored)) > 0.1, effect.id


def test_effects_behind_one_draw_add_up(two_sensors):
    motor, tests = two_sensors
    alone = Model.of("second", motor).scaled(motor, tests)
    values = centre_of(alone, motor, tests)
    named = {"ambient_recirculation": {"r": 0.02}, "ac_copper_loss": {"k": 0.5}}
    effects = []
    for kind in (each for each in EFFECTS if each.card.id in named):
        own = {f"{kind.card.id}.{n}": v for n, v in named[kind.card.id].items()}
        effects.append(PlausibleEffect(kind, None, 0.5, {**values, **own}, values))

    def median(*sizes):
        plausible = PlausibleEffects(tuple(effects), np.tile(sizes, (NUM_DRAWS, 1)))
        drawn = draws_of(alone, motor, tests, plausible)
        return predict(drawn, tests[0], fitted_as=tests[0].name).median

    bare, first, second = median(0.0, 0.0), median(1.0, 0.0), median(0.0, 0.5)
    assert np.ptp(first - bare) > 0.1
    assert np.ptp(second - bare) > 0.1
    np.testing.assert_allclose(median(1.0, 0.5), first + second - bare, atol=1e-6)


def test_an_effect_with_which_the_machine_runs_away_says_nothing_of_a_test(two_sensors):
    """And a draw of the network that runs away has limits, and no warning of NumPy's."""
    motor, tests = two_sensors
    alone = Model.of("second", motor).scaled(motor, tests)
    known = parameters(alone, motor, [alone.with_bodies(test) for test in tests]).by_test[0]
    values = {name: p.centre for name, p in known.items() if not p.per_test}
    named = "ambient_recirculation.r"

    def found(size, **away):
        with_effect = {**values, named: 0.02, **away}
        effect = PlausibleEffect(RECIRCULATION, None, 0.5, with_effect, values)
        sizes = np.zeros((NUM_DRAWS, 1))
        sizes[: NUM_DRAWS // 2] = size
        plausible = PlausibleEffects((effect,), sizes)
        return predict(draws_of(alone, motor, tests, plausible), tests[0])

    bare, small, away = found(0.0), found(1.0), found(1.0, Req_sr=-1e-3)
    assert np.max(np.abs(small.sd - bare.sd)) > 0.1
    np.testing.assert_allclose(away.sd, bare.sd)
    np.testing.assert_allclose(away.draws, bare.draws)
    fast = {**values, "Req_sr": np.array([1.0, -5e-4])}
    course = courses(alone, {n: np.broadcast_to(v, 2) for n, v in fast.items()} | {
        n: np.full(2, p.centre) for n, p in known.items() if p.per_test}, tests[0])  # fmt: skip
    assert np.all(np.isfinite(np.std(course.reading, axis=0)))
