"""The search for effects: two at once, one linear evidence, soft priors."""

import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from hidden_machines import machine

from heatrun.discovery.discovery import Adequacy, verdict
from heatrun.effects import engine as engine_module
from heatrun.effects import search as search_module
from heatrun.effects.engine import Candidate, Engine, library, white
from heatrun.effects.found import as_fit, asked_findings, find, with_catalogue
from heatrun.effects.linear import Linear, evidence
from heatrun.effects.search import Search, neighbours
from heatrun.fit.fit import fit
from heatrun.model.model import Model
from heatrun.model.noise import scale_of
from heatrun.model.problem import Problem
from heatrun.record.record import Record
from heatrun.record.reduction import reduce
from lptn import EFFECTS
from lptn.effects.bodies import HousingNode, NeighbourBody
from lptn.effects.heat_paths import AmbientDrift, CoolingStep, NaturalConvection, Radiation

FEW = ("speed_cooling", "sensor_lag", "rotor_node", "ambient_drift", "stray_load_loss")


@pytest.fixture(scope="module")
def two(hidden_bench):
    """A machine with a fan on its shaft and a sensor that lags."""
    case, motor, (staircase, _), tests = machine(
        hidden_bench, ("speed_cooling", "sensor_lag"), 43, amplitude=1.0
    )
    return case, motor, [staircase], tests


@pytest.fixture(scope="module")
def searched(two):
    _, motor, tests, _ = two
    model = Model.of("second", motor).scaled(motor, tests)
    return find(model, motor, [model.with_bodies(test) for test in tests])


def test_sets_are_searched_in_one_order_in_every_process():
    """The order of fits moves their last digits, and on a record without noise what is found.

    In another process the effects lie elsewhere in the memory, and words have other hashes.
    """
    code = (
        "from heatrun.effects.engine import Candidate; from lptn.effects import EFFECTS; "
        "print(*[each.id for each in frozenset(map(Candidate, EFFECTS))])"
    )
    seed = "2" if os.environ.get("PYTHONHASHSEED") == "1" else "1"
    told = subprocess.check_output(
        [sys.executable, "-c", code], env={**os.environ, "PYTHONHASHSEED": seed}, text=True
    )
    assert told.split() == [each.id for each in frozenset(map(Candidate, EFFECTS))]


def test_two_effects_at_once_are_both_found(searched):
    assert set(searched.ids) == {"speed_cooling", "sensor_lag"}
    for effect in searched.core.effects:
        assert searched.probability(effect) > 0.95
        assert searched.log_bayes(effect) > 10.0
    assert searched.familywise_p < 1e-6


def test_the_gap_is_closed_without_an_absurd_size(two, searched):
    case, _, _, _ = two
    before, after = (fit.stats["rmse_white_K"] for fit in searched.fits)
    assert after < 0.3 * before
    values = searched.fit.values()
    assert values["speed_cooling.g"] < 5.0
    assert values["Req_w"] == pytest.approx(case.machine.Req_w, rel=0.15)


def test_a_trace_neither_enters_the_model_nor_takes_the_place_of_an_effect(searched):
    """A shift of 2 s that closes 0.02 K is asked for by 40 nat, once the lag is in the model: no
    lag of a sensor is quite of first order. It closes nothing of what the fan does.
    """
    assert "time_shift" in searched.best.ids
    assert "time_shift" not in searched.ids


def test_what_jumps_with_the_load_is_sought_where_samples_jump(searched):
    """Means over 20 s take a fast body and a late reading for it; the samples do not."""
    assert "jump" in searched.library.unavailable["sensor_pickup"]


def test_what_the_line_of_the_sensor_picks_up_is_no_fast_body(hidden_bench):
    case, motor, (staircase, _), _ = machine(hidden_bench, ("sensor_pickup",), 45, amplitude=1.0)
    model = Model.of("second", motor).scaled(motor, [staircase])
    searched = find(model, motor, [model.with_bodies(staircase)])
    assert searched.ids == ("sensor_pickup",)
    values = searched.fit.values()
    assert values["Ceq_w"] == pytest.approx(case.machine.Ceq_w, rel=0.1)
    largest = np.max(case.tests[0].columns["phase_current_A"])
    rated_A = float(staircase.means["rated_current"])
    assert values["sensor_pickup.p"] == pytest.approx(6.0 * rated_A / largest, rel=0.1)


def test_the_noise_of_loggers_is_told_by_the_network_with_its_effects(hidden_bench):
    """That of the network alone holds what it misses, which is of another size in each test."""
    case, motor, _, _ = machine(hidden_bench, ("speed_cooling", "sensor_lag"), 43, amplitude=1.0)
    made = [each for each in case.tests if each.role == "calibration"]
    coarse = dict(made[1].columns)
    read = np.asarray(coarse["winding_degC"])
    noisy = read + 0.5 * np.random.default_rng(3).standard_normal(read.size)
    coarse["winding_degC"] = 0.5 * np.rint(noisy / 0.5)
    tests = [reduce(Record(name, columns), motor)
             for name, columns in (("fine", made[0].columns), ("coarse", coarse))]  # fmt: skip
    model = Model.of("second", motor).scaled(motor, tests)
    alone = fit(Problem.of(model, motor, tests))
    found = find(model, motor, [model.with_bodies(test) for test in tests], start=alone)
    assert set(found.ids) == {"speed_cooling", "sensor_lag"}

    def ratio(fitted):
        fine, noisy = (scale_of(fitted.problem.loggers, test.loggers[0]) for test in tests)
        return noisy / fine

    assert ratio(found.fit) > 1.5 > ratio(alone)


@pytest.fixture(scope="module")
def search(two):
    _, motor, tests, _ = two
    model = Model.of("second", motor).scaled(motor, tests)
    rows = [model.with_bodies(test) for test in tests]
    library, extended = with_catalogue(model, motor, rows)
    wanted = [each for each in library.candidates if each.id in FEW]
    engine = Engine(Problem.of(extended, motor, rows))
    every = Search(engine, library.candidates)
    search = Search(engine, wanted)
    search.base = every.base  # those that are not searched stay away
    search.fit(frozenset(), every.placed(np.zeros(len(engine.slots)), ()))
    return search


def test_absent_effects_leave_the_network_as_it_was(search):
    engine = search.engine
    none = search.fitted[frozenset()]
    values, gains = engine.values(none.z, 0)
    assert values["speed_cooling.g"] == 0.0
    assert values["cooling_step.k"] == 1.0
    assert gains[engine.find("speed_cooling.g")] == 0.0
    # a vanishing size is the same machine
    z = none.z.copy()
    slots = search.own[next(each for each in search.candidates if each.id == "sensor_lag")]
    z[list(slots)] = -30.0
    near, absent = (engine.linearise(each, [])[0] for each in (z, none.z))
    np.testing.assert_allclose(near, absent, atol=1e-6)


def test_a_set_that_leaves_the_numbers_is_the_least_probable(search, monkeypatch):
    few = frozenset(search.candidates[:1])
    lost = replace(search, fitted=dict(search.fitted))
    with monkeypatch.context() as patched:
        patched.setattr(search_module, "log_evidence", lambda *given: np.nan)
        lost.fit(few, search.fitted[frozenset()].z)
    assert lost.fitted[few].log_weight == -np.inf
    again = lost.fit(few, search.fitted[frozenset()].z)
    assert np.isfinite(again.log_weight)
    assert np.isfinite(list(lost.around(again).values())).all()


def test_no_fit_follows_a_slope_that_has_no_square(search, monkeypatch):
    engine, none = search.engine, search.fitted[frozenset()]
    real = engine_module._course

    def stiff(*given):
        means, slope = real(*given)
        return means, np.where(np.arange(len(slope))[:, None] > 9, 1e200 * np.sign(slope), slope)

    columns = list(search.base)
    followed = engine.linearise(none.z, columns)[1]
    monkeypatch.setattr(engine_module, "_course", stiff)
    slopes = engine.linearise(none.z, columns)[1]
    np.testing.assert_array_equal(slopes[:10], followed[:10])
    assert not slopes[10:].any()
    with np.errstate(over="raise", invalid="raise"):
        assert np.isfinite(engine.refit(none.z, columns, white(0.5)).log_det)


def test_many_places_side_by_side_are_as_each_alone(search):
    """More of them than go at once, with no column, with one of a test's own, and with several."""
    engine, none = search.engine, search.fitted[frozenset()]
    starts = next(i for i in search.base if engine.slots[i].test == 0)
    jobs = [(none.z, []), (none.z, [starts])]
    for places in search.own.values():
        z = none.z.copy()
        z[list(places)] = 0.1
        jobs += [(z, list(places)), (z, [*places, starts]), (z, [])]
    assert sum(max(1, len(columns)) for _, columns in jobs) > 24
    for (residual, slopes), job in zip(engine.linearise_many(jobs), jobs, strict=True):
        of_one = engine.linearise(*job)
        np.testing.assert_allclose(residual, of_one[0], atol=1e-9)
        np.testing.assert_allclose(slopes, of_one[1], atol=1e-9)


def test_the_linear_evidence_is_that_of_a_fit_near_by(search):
    """A set around a fitted one, by one linearisation and by a fit under the same noise."""
    effects = frozenset(e for e in search.candidates if e.id in ("speed_cooling", "sensor_lag"))
    centre = search.fit(effects, search.fitted[frozenset()].z)
    linear = Linear(search.engine, search.own, search.base, centre, {})
    assert linear.log_evidence(effects) == pytest.approx(centre.log_evidence, abs=1e-6)
    more = next(s for s in neighbours(effects, search.candidates)
                if len(s) == 3 and any(each.id == "ambient_drift" for each in s))  # fmt: skip
    fitted = search.fit(more, linear.scores(more), centre)
    # its noise is its own, which gains at most a little
    assert linear.log_evidence(more) == pytest.approx(fitted.log_evidence, abs=1.5)


def test_the_evidence_of_a_linear_model_is_exact():
    """One parameter by quadrature."""
    rng = np.random.default_rng(2)
    column, noise = rng.standard_normal(20), rng.standard_normal(20)
    at = 0.7
    residual = noise + 1.3 * column  # where the score is `at`
    joined = np.column_stack([residual, column])
    value, step = evidence(joined.T @ joined, np.array([at]))
    z = np.linspace(-12.0, 12.0, 200_001)
    squares = np.sum((residual[:, None] + column[:, None] * (z - at)) ** 2, axis=0) + z**2
    integral = np.log(np.trapezoid(np.exp(-0.5 * squares), z)) - 0.5 * np.log(2.0 * np.pi)
    assert value == pytest.approx(integral, abs=1e-9)
    assert at + step[0] == pytest.approx(z[np.argmin(squares)], abs=2e-4)


def test_what_cannot_be_is_a_bound(search):
    """A share above one: the fit of it stays below, however far the tests pull."""
    engine = search.engine
    slot = engine.find("housing_node.x")
    _, high = engine.bounds([slot])
    assert float(engine.slots[slot].parameter.value(high[0])) == pytest.approx(1.0)


def test_what_half_of_the_evidence_does_not_ask_for_is_allowed_for(search):
    """It is in the model, without the effects that close nothing of the gap, however many."""
    fan, lag, rotor = (next(e for e in search.candidates if e.id == name)
                       for name in ("speed_cooling", "sensor_lag", "rotor_node"))  # fmt: skip
    z = search.fitted[frozenset()].z
    few, both, more = (
        search.fit(frozenset(each), z) for each in ([fan], [fan, lag], [fan, lag, rotor])
    )
    none = search.fitted[frozenset()]
    told = {each.effects: replace(each, log_weight=0.0) for each in (none, few, both)}
    told[more.effects] = replace(more, log_weight=1.0)
    reached_K = {few.effects: 1.0, both.effects: 0.10, more.effects: 0.10}
    tried = replace(search, fitted=dict(told), _reached=reached_K)
    assert tried.fullest(told[few.effects]).effects == both.effects
    assert tried.fullest(told[both.effects]).effects == both.effects
    reached_K[more.effects] = 0.09  # a trace moves the parameters too
    tried = replace(search, fitted=dict(told), _reached=reached_K)
    assert tried.fullest(told[few.effects]).effects == more.effects
    told[few.effects] = replace(few, log_weight=2.0)
    tried = replace(search, fitted=dict(told), _reached=reached_K)
    assert tried.fullest(told[few.effects]).effects == few.effects
    assert tried.fullest(none) is none  # an effect beside none is averaged over, not in the model


def test_all_of_the_evidence_decides_between_what_half_of_it_leaves_possible(search):
    fan, lag, rotor = (next(e for e in search.candidates if e.id == name)
                       for name in ("speed_cooling", "sensor_lag", "rotor_node"))  # fmt: skip
    z = search.fitted[frozenset()].z
    none, here, rival, more = map(frozenset, ([], [fan], [lag], [lag, rotor]))
    weights = {none: 5.0, here: 0.0, rival: -1.0, more: 1.0}
    told = {e: replace(search.fit(e, z), log_weight=weight) for e, weight in weights.items()}
    tried = replace(search, fitted=told)
    tried.around = lambda member: {member.effects: 1.0}
    chosen, around = tried.decided(told[here], {here: 0.7, rival: 0.2, none: 0.1})
    assert (chosen.effects, around) == (rival, {rival: 1.0})
    unlikely = {here: 0.7, rival: 0.04, none: 0.26}
    assert tried.decided(told[here], unlikely) == (told[here], unlikely)
    told[here | {rotor}] = replace(told[more], effects=here | {rotor}, log_weight=2.0)
    assert tried.decided(told[here], {here: 0.5, rival: 0.5})[0].effects == here


def test_what_is_allowed_for_is_told_apart_from_what_is_named(searched):
    fan = next(each for each in searched.core.effects if each.id == "speed_cooling")
    less = searched.search.fitted[searched.core.effects - {fan}]
    found = replace(searched, core=less, around={less.effects: 1.0}, full=searched.core)
    assert found.ids == ("sensor_lag",)
    assert found.allowed_for == ("speed_cooling",)
    (finding,) = asked_findings(found, is_plain=False)
    assert "ask for sensor_lag (100 %): these are in the model" in finding.message
    assert "The model allows for speed_cooling too" in finding.message
    left = Adequacy(excess=1.0, is_excessive=False, correlation_s=0.0, misfit_K=0.02, rmse_K=0.1,
                    window_s=600.0, noise_K=0.1)  # fmt: skip
    said = verdict(found, None, replace(left, misfit_K=2.0, is_excessive=True), left, "heatrun")
    assert said.word == "named"
    assert said.sentence.startswith("Missing: sensor_lag, allowing for speed_cooling. So extended")


def test_an_event_in_two_tests_is_in_both(two):
    _, motor, _, (*tests, _) = two
    model = Model.of("second", motor).scaled(motor, tests)
    rows = [model.with_bodies(test) for test in tests]
    library, extended = with_catalogue(model, motor, rows, (CoolingStep,))
    search = Search(Engine(Problem.of(extended, motor, rows)), library.candidates)
    none = search.fit(frozenset(), search.placed(np.zeros(len(search.engine.slots)), ()))
    search.fit(frozenset(library.candidates), none.z)
    fit = as_fit(search, search.fitted[frozenset(library.candidates)], model)
    free = {slot.name for slot in fit.slots}
    assert {f"cooling_step.k[{test.name}]" for test in tests} <= free


def test_a_channel_that_one_test_lacks_is_told_with_the_effects_that_it_keeps_out(searched):
    """A locked rotor recorded without a speed kept the fan of all tests out, in silence."""
    test = searched.search.engine.tests[0]
    locked = replace(
        test, name="locked", means={k: v for k, v in test.means.items() if k != "speed"}
    )
    network = searched.search.engine.problem.model.topology()
    assert library(EFFECTS, network, [test]).in_some == {}
    assert library(EFFECTS, network, [locked]).in_some == {}
    both = library(EFFECTS, network, [test, locked])
    ((channel, without),) = both.in_some
    assert (channel, without) == ("speed_rpm", ("locked",))
    assert "speed_cooling" in both.in_some[channel, without]
    assert "speed_cooling" in both.unavailable
    finding = asked_findings(replace(searched, library=both), is_plain=False)[0]
    assert finding.id == "channel_in_some_tests"
    assert "locked has no speed_rpm" in finding.message
    assert "speed_rpm under [constants]" in finding.remedy


@pytest.mark.parametrize("losses", ["balance", "map"])
def test_heat_that_a_measured_balance_holds_is_sought_under_a_map_alone(two, losses):
    _, motor, tests, _ = two
    motor = replace(motor, losses=losses)
    library, _ = with_catalogue(Model.of("second", motor), motor, tests)
    for effect in ("bearing_friction", "standby_loss"):
        reason = library.unavailable.get(effect, "")
        assert (losses == "balance") == ("measured balance" in reason)


def test_what_tests_do_not_tell_apart_widens_the_intervals(searched):
    """Two networks of one probability: the interval holds the parameters of both."""
    core = searched.core
    lag = next(each for each in core.effects if each.id == "sensor_lag")
    other = next(each for each in searched.library.candidates if each.id == "time_shift")
    rival = searched.search.fit(core.effects - {lag} | {other}, core.z, core)
    assert searched.undecided() is None
    tied = replace(searched, around={core.effects: 0.5, rival.effects: 0.5})
    assert [each.id for each in tied.tied(lag)] == ["time_shift"]
    model, values = tied.undecided()
    engine = searched.search.engine
    for name in ("Ceq_w", "Ceq_sr", "Req_w", "Req_sr"):
        slot, (low, high) = engine.find(name), np.quantile(values[name], [0.025, 0.975])
        for member in (core, rival):
            value = float(engine.slots[slot].parameter.value(member.z[slot]))
            assert low < value < high, name
    # each draw is a machine of one of the sets: no draw has both effects, each has one
    assert {kind.card.id for kind in model.effects} >= {"sensor_lag", "time_shift"}
    has_lag, has_shift = values["sensor_lag.tau"] > 0.0, values["time_shift.d"] != 0.0
    assert np.array_equal(has_lag, ~has_shift)
    assert 0.4 < np.mean(has_lag) < 0.6
    (finding, _) = asked_findings(tied, is_plain=False)
    assert finding.id == "effect_ambiguous"
    assert finding.values == {"sensor_lag": 0.5, "time_shift": 0.5}


def test_the_evidence_between_rivals_counts_by_half(searched):
    """The odds of an effect count whole: they are no matter of how exact its law is."""
    search, here = searched.search, searched.core
    shares = search.around(here)
    assert sum(shares.values()) == pytest.approx(1.0)
    fewer = max((each for each in shares if len(each) < len(here.effects)), key=shares.__getitem__)
    behind = search.fitted[fewer].log_evidence - here.log_evidence
    lacking = search.log_odds(here.effects - fewer)
    assert np.log(shares[fewer] / shares[here.effects]) == pytest.approx(0.5 * behind - lacking)


def test_the_evidence_survives_columns_that_are_one():
    """Of large signatures that are nearly one, the products keep no trace of the prior."""
    rng = np.random.default_rng(3)
    column = 1e9 * rng.standard_normal(40)
    twins = [column * factor for factor in (1.0, 1.0 - 1e-9, 1.0 + 1e-9)]
    joined = np.column_stack([rng.standard_normal(40), *twins])
    value, step = evidence(joined.T @ joined, np.zeros(3))
    assert np.isfinite(value)
    # what one column of all three amplitudes would take
    assert np.sum(step) == pytest.approx(-joined[:, 0] @ column / (column @ column), rel=1e-2)


@pytest.mark.slow
def test_a_twin_is_told_although_it_explains_nothing_beside_the_other(hidden_bench, monkeypatch):
    """A winding with a constant sink never tells a housing from a body beside the stator."""
    monkeypatch.setattr("heatrun.effects.search.MOST_RIVALS", 1)
    _, motor, tests, _ = machine(hidden_bench, ("neighbour_body",), 43, target_K=1.2)
    model = Model.of("second", motor).scaled(motor, tests)
    rows = [model.with_bodies(test) for test in tests]
    kinds = (HousingNode, NeighbourBody, AmbientDrift, NaturalConvection, Radiation)
    found = find(model, motor, rows, kinds=kinds)
    (body,) = found.core.effects
    assert {"housing_node", "neighbour_body"} == {body.id, *(one.id for one in found.tied(body))}
