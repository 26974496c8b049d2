"""The budget of a calibration against a closed form, a fit anew, and simulated errors."""

from dataclasses import replace
from xml.etree import ElementTree

import jax
import numpy as np
import pytest
from dcc_structure import DCC, SI, violations
from test_dcc import STATED, STORED

from heatrun.effects.small_effects import SmallEffects, averaged
from heatrun.fit.fit import fit
from heatrun.fit.restricted import whiten_fit
from heatrun.io.texts import Texts
from heatrun.model import noise as noise_module
from heatrun.model.model import Model
from heatrun.model.problem import Problem
from heatrun.posterior.posterior import normal_draws
from heatrun.record.motor import ParameterOverride
from heatrun.reports.certificate import figure_lines, parameter_lines
from heatrun.reports.content import _budget
from heatrun.reports.dcc import dcc_text
from heatrun.reports.printed import format_value
from heatrun.results import FitResult
from heatrun.results.values import Part, budget, combined, from_json
from heatrun.runs.figures_of_draws import (
    HEAT,
    NOISE,
    SMALL_EFFECTS,
    UNDECIDED,
    DrawValues,
    budget_of,
)
from heatrun.runs.ratings_figures import derive
from heatrun.runs.result import describe_model
from lptn.effects import EFFECTS

NAMES = ("Ceq_w", "Ceq_sr", "Req_w", "Req_sr")


@pytest.fixture(scope="module")
def posterior(fitted):
    return normal_draws(fitted)


@pytest.fixture(scope="module")
def budgets(posterior):
    of = budget_of(posterior)
    return {name: of(posterior.values()[name].ravel()) for name in NAMES}


def row_of(rows, source):
    return next(row for row in rows if row.source == source)


def test_the_budget_is_that_of_the_draws(budgets, posterior, fitted):
    for name, rows in budgets.items():
        draws, place = posterior.values()[name].ravel(), fitted.problem.parameters.index(name)
        assert sum(row.share for row in rows) == pytest.approx(1.0)
        # 2000 draws: 1.6 % of a standard deviation
        assert combined(rows) == pytest.approx(np.std(draws), rel=0.06)
        type_a = combined(row for row in rows if row.type == "A") / combined(rows)
        variance = fitted.covariance[place, place]
        assert type_a**2 == pytest.approx(
            fitted.covariance_type_a[place, place] / variance, abs=2e-3
        )


def test_a_factor_on_all_losses_is_one_on_capacities_and_conductances(budgets, posterior):
    """Closed form: no temperature changes if losses and capacities rise and resistances fall.

    The copper loss goes with the square of the current.
    """
    factors = {"relative error of the losses": 1.0, "relative error of the current": 0.5}
    for name, rows in budgets.items():
        moved = sum(row_of(rows, source).sensitivity * by for source, by in factors.items())
        sign = 1.0 if name.startswith("C") else -1.0
        # the prior of the phase resistance, 1 %, is the only thing that knows better
        assert moved == pytest.approx(sign * np.mean(posterior.values()[name]), rel=0.06), name


def test_without_a_source_a_fit_anew_is_narrower_by_its_share(blocks, motor, budgets, fitted):
    """The tests tell nothing of the scale of the losses: its share is what goes with it."""
    certain = replace(motor, parameters={"power_gain": ParameterOverride(sd=1e-6)})
    anew = fit(Problem.of(Model.of("second", certain), certain, [blocks]))
    place = fitted.problem.parameters.index("Req_sr")
    fell = 1.0 - anew.covariance[place, place] / fitted.covariance[place, place]
    share = row_of(budgets["Req_sr"], "relative error of the losses").share
    assert fell == pytest.approx(share, abs=0.01)
    assert share > 0.1


def test_noise_and_heat_that_are_drawn_move_the_estimate_by_their_rows(budgets, posterior, fitted):
    problem, size = fitted.problem, fitted.z.size
    (observed,) = problem.data.tests
    residual, jacobian = fitted.residual[0], fitted.jacobian[0]
    white = whiten_fit(problem, fitted.noise_z, residual, jacobian).jacobian
    without = replace(fitted.noise, heat=np.zeros(()))
    for noise, sources in ((fitted.noise, (NOISE, HEAT)), (without, (NOISE,))):
        drawn = noise_module.draw(jax.random.key(3), noise, observed, (60 * size,))
        pieces = np.split(problem.tests[0].own(np.asarray(drawn).T), 60, axis=1)
        rows = [whiten_fit(problem, fitted.noise_z, residual, each).jacobian for each in pieces]
        moved = fitted.covariance[:size, :size] @ white.T @ np.concatenate(rows, axis=1)
        for name in NAMES:
            place = problem.parameters.index(name)
            scale = fitted.slots[place].parameter.sd * np.mean(posterior.values()[name])
            said = combined(row for row in budgets[name] if row.source in sources)
            # 660 draws: 2.8 % of a standard deviation
            assert scale * np.std(moved[place]) == pytest.approx(said, rel=0.1), name


def test_small_effects_behind_the_draws_have_a_row(posterior, fitted):
    size, place = fitted.z.size, fitted.problem.parameters.index("Req_w")
    turn = np.zeros((size, 1))
    turn[place] = 0.05
    sizes = np.where(np.arange(400) % 2, 0.4, 0.0)[:, None]
    behind = averaged(posterior, SmallEffects(1.0, (), (None,), sizes, turn))
    draws = behind.values()["Req_w"].ravel()
    rows = budget_of(behind)(draws)
    parameter = fitted.slots[place].parameter
    by_hand = np.median(draws) * parameter.sd * 0.05 * 0.2
    assert row_of(rows, SMALL_EFFECTS).contribution == pytest.approx(by_hand, rel=0.06)
    assert combined(rows) == pytest.approx(np.std(draws), rel=0.06)


def test_a_budget_of_some_draws_is_that_of_all(posterior):
    of, draws = budget_of(posterior), posterior.values()["Req_w"].ravel()
    picked = np.random.default_rng(1).permutation(draws.size)[:300]
    some, every = of(draws[picked], picked=picked), of(draws)
    assert combined(some) == pytest.approx(combined(every), rel=0.02)
    for row in (row for row in every if row.share > 0.05):
        same = row_of(some, row.source).contribution
        assert same == pytest.approx(row.contribution, rel=0.05), row.source


def test_ratings_that_are_asked_for_have_one(posterior):
    problem = posterior.fit.problem
    rated = replace(problem, motor=replace(problem.motor, insulation_class="F"))
    made = replace(posterior, fit=replace(posterior.fit, problem=rated))
    found = derive(made, ("S2-30", "time:250A:cold"), budget_of(made))
    for name in ("S2-30_current_A", "time_to_limit_250A_cold_s"):
        figure = found[name]
        # 300 draws: 4 % of a standard deviation; where the time bends, the draws hold
        assert combined(figure.budget) == pytest.approx(figure.sd, rel=0.2), name


@pytest.fixture(scope="module")
def described(posterior):
    return describe_model(posterior, [], [])


def test_sheet_and_certificate_state_it(described):
    for language in ("de", "it"):
        say = Texts(language)
        told = _budget(parameter_lines(described, say), say)
        assert [row[0] for row in told["rows"]] == [*NAMES, "Rs0"]
        for row in told["rows"]:  # each source is named once, and the shares make up the whole
            assert len(row) == len(told["head"])
            assert sum(float(share.removesuffix(" %")) for share in row[3:]) == pytest.approx(
                100.0, abs=3.0
            )
        assert not say.unknown
    result = from_json(STORED.read_bytes(), FitResult, "fit.json", str(STORED))
    root = ElementTree.fromstring(dcc_text(replace(result, models={"second": described}), STATED))
    assert violations(root) == []
    _, follows, *found = root.iter(f"{DCC}result")
    lines = [line for line in figure_lines(described) if line.sd > 0]
    assert len(found) == len(NAMES) + 1 + len(lines)
    assert [each.text for each in follows.iter(f"{SI}value")] == [
        format_value(line.figure.median, 2.0 * line.sd)[0] for line in lines
    ]
    rows = described.parameters["Ceq_w"].budget
    reals = [float(each.findtext(f"{SI}value") or "") for each in found[0].iter(f"{SI}real")]
    parts = [row.contribution for row in rows]
    assert reals == pytest.approx([*parts, combined(rows)], rel=5e-3)
    words = [each.text or "" for each in found[0].iter(f"{DCC}content")]
    noise = words[words.index(NOISE) + 1]
    assert "J/K per 1 K; type A; share of the variance" in noise


def test_what_follows_from_the_parameters_has_a_budget(described):
    lines = {line.name: line for line in figure_lines(described)}
    assert {"tau_fast", "tau_slow", "steady_rise", "continuous_current"} <= set(lines)
    for line in lines.values():
        assert combined(line.budget) == pytest.approx(line.sd, rel=0.06), line.name
    # a factor on all losses is one on the conductances: the rise stays where it was measured
    factors = {"relative error of the losses": 1.0, "relative error of the current": 0.5}
    rise = lines["steady_rise"]
    moved = sum(row_of(rise.budget, source).sensitivity * by for source, by in factors.items())
    assert abs(moved) < 0.05 * rise.figure.median


def test_a_widened_parameter_says_what_by(posterior, described):
    entry = described.parameters["Req_w"]
    assert not [row for row in entry.budget if row.source == UNDECIDED]
    low, high = entry.interval_95
    apart = np.linspace(low - 4.0 * entry.sd, high + 4.0 * entry.sd, 100)
    values = {name: np.full(100, np.median(each)) for name, each in posterior.values().items()}
    wider = DrawValues(posterior.fit.problem.model, values | {"Req_w": apart}, ())
    wide = describe_model(posterior, [], [], undecided=wider).parameters["Req_w"]
    row = row_of(wide.budget, UNDECIDED)
    assert row.contribution == pytest.approx(np.sqrt(wide.sd**2 - entry.sd**2))
    assert combined(wide.budget) == pytest.approx(wide.sd, rel=0.06)


def test_a_resistance_under_load_holds_what_it_is_in_networks_not_told_apart(blocks, motor):
    effect = next(kind for kind in EFFECTS if kind.card.id == "radiation")
    known = replace(motor, parameters={"radiation.eA": ParameterOverride(value=0.1, sd=0.01)})
    problem = Problem.of(Model.of("second", known, (effect,)), known, [blocks])
    found = normal_draws(fit(problem, num_starts=4))
    alone = {name: each.ravel() for name, each in found.values().items()}
    rivals = DrawValues(problem.model, alone | {"Req_sr": 1.3 * alone["Req_sr"]}, ())
    told, not_told = (
        describe_model(found, [], [], undecided=each).derived for each in (None, rivals)
    )
    one, both = (each["Req_sr_loaded"] for each in (told, not_told))
    assert (one.identifiability, both.identifiability) == ("identified", "weak")
    assert both.value == one.value
    assert both.ends[0] == one.ends[0]
    assert both.ends[1] > 1.1 * one.ends[1]
    row = row_of(both.budget, UNDECIDED)
    assert row.contribution == pytest.approx(np.sqrt(both.sd**2 - one.sd**2))
    # what follows holds it too
    for name, side in (("steady_rise_K", 1), ("continuous_current_A", 0)):
        moved = not_told[name].ends[side] - told[name].ends[side]
        assert abs(moved) > 2.0 * told[name].sd, name
        assert not_told[name].ends[1 - side] == told[name].ends[1 - side], name
        assert combined(not_told[name].budget) == pytest.approx(not_told[name].sd, rel=0.1)


def test_a_budget_of_nothing_is_empty():
    assert budget(()) == ()
    (row,) = budget([Part("leads", "B", -2.0, 4.0, "ohm")])
    assert (row.sensitivity, row.contribution, row.share) == (-0.5, 2.0, 1.0)


def test_a_resistance_under_load_has_a_budget_of_its_own(blocks, motor):
    effect = next(kind for kind in EFFECTS if kind.card.id == "speed_cooling")
    known = replace(motor, parameters={"speed_cooling.g": ParameterOverride(value=0.3, sd=0.1)})
    problem = Problem.of(Model.of("second", known, (effect,)), known, [blocks])
    entry = describe_model(normal_draws(fit(problem, num_starts=4)), [], [])
    figure = entry.derived["Req_sr_loaded"]
    assert combined(figure.budget) == pytest.approx(figure.sd, rel=0.1)
    # what the cooling gains hangs on its prior; under load the tests tell most of it
    of_law, of_load = (row_of(each, "priors of the effects' parameters").contribution
                       for each in (entry.parameters["Req_sr"].budget, figure.budget))  # fmt: skip
    assert of_law > 2.0 * of_load
