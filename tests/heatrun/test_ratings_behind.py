"""Figures of draws with an effect behind them are those of the network with that effect."""

from __future__ import annotations

import numpy as np
import pytest
from msgspec import UNSET
from test_ratings_figures import BY_ID, NUM, TRUE, motor, posterior

from heatrun.model.draws import PlausibleEffect, PlausibleEffects
from heatrun.runs.ratings_figures import derive

NONE = -1
FIGURES = ("steady_rise_K", "continuous_current_A", "time_to_limit_cold_s", "S2-30_current_A")


def behind(effects, which, size=1.0):
    """The draws at `TRUE`, with one effect of some behind each, or none."""
    drawn = posterior("second", motor(), TRUE)
    sizes = size * (np.broadcast_to(which, NUM)[:, None] == np.arange(len(effects)))
    drawn.plausible = PlausibleEffects(tuple(effects), sizes)
    return drawn


def effect(name, amounts, shift=None, probability=0.9, test=None):
    """An effect with given amounts; without it, the parameters of `shift` have other values."""
    own = {f"{name}.{key}": value for key, value in amounts.items()}
    nulls = {f"{name}.{key}": q.null for key, q in BY_ID[name].card.parameters.items()}
    without = own | {k: v for k, v in nulls.items() if v is not None} | TRUE
    return PlausibleEffect(BY_ID[name], test, probability, own | TRUE | (shift or {}), without)


def values(drawn):
    """The figures that are not refused."""
    found = derive(drawn, ["S2-30"])
    return {name: found[name].value for name in FIGURES if found[name].refused is UNSET}


@pytest.mark.parametrize(
    ("name", "amounts"),
    [
        ("ambient_recirculation", {"r": 0.02}),
        ("ac_copper_loss", {"k": 1.0}),
        ("speed_cooling", {"g": 0.3, "m": 0.8}),
    ],
)
def test_an_effect_behind_all_draws_is_the_network_with_it(name, amounts):
    given = effect(name, amounts)
    known = posterior("second", motor(), TRUE | given.with_effect, effects=[name])
    expected, found = values(known), values(behind([given], 0))
    bare = values(posterior("second", motor(), TRUE))
    assert abs(expected["steady_rise_K"] / bare["steady_rise_K"] - 1.0) > 0.01  # it matters
    assert found == pytest.approx(expected, rel=1e-6)


def test_half_the_size_is_half_the_amount():
    whole, half = (effect("ambient_recirculation", {"r": r}) for r in (0.02, 0.01))
    expected, found = values(behind([half], 0)), values(behind([whole], 0, size=0.5))
    assert found == pytest.approx(expected, rel=1e-9)


def test_a_resistance_that_the_effect_acts_on_goes_where_the_effect_has_it():
    """In the draws it stands for its mean over the tests."""
    moved = {"Req_sr": 0.14}
    given = effect("speed_cooling", {"g": 0.3, "m": 0.8}, shift=moved)
    known = posterior("second", motor(), given.with_effect, effects=["speed_cooling"])
    assert values(behind([given], 0)) == pytest.approx(values(known), rel=1e-6)


def test_each_draw_has_its_own_effect_or_none():
    """A third of the draws each: alone, and with either of two effects."""
    first = effect("ambient_recirculation", {"r": 0.02}, probability=0.3)
    second = effect("speed_cooling", {"g": 0.3, "m": 0.8}, probability=0.3)
    which = np.arange(NUM) % 3 - 1
    assert NONE in which
    low, high = derive(behind([first, second], which))["steady_rise_K"].interval_95
    of_each = [derive(behind([first, second], index))["steady_rise_K"].value
               for index in (NONE, 0, 1)]  # fmt: skip
    assert (low, high) == pytest.approx((min(of_each), max(of_each)), rel=1e-9)


def test_a_likely_effect_stands_in_the_condition():
    told = derive(behind([effect("ambient_recirculation", {"r": 0.02})], 0))
    assert told["steady_rise_K"].condition.endswith("with ambient_recirculation")
    assert "recirculation" not in told["tau_slow_s"].condition  # of the network alone
    rare = effect("ambient_recirculation", {"r": 0.02}, probability=0.2)
    assert "recirculation" not in derive(behind([rare], 0))["steady_rise_K"].condition


def test_an_event_of_one_test_is_none_of_the_machine():
    name = next(k.card.id for k in BY_ID.values() if k.card.family == "event")
    amounts = {key: 0.5 * (q.low + q.high) for key, q in BY_ID[name].card.parameters.items()}
    drawn = behind([effect(name, amounts, test="duty")], 0)
    assert values(drawn) == values(posterior("second", motor(), TRUE))
