"""Discovery on benches with a hidden cause: a small version of the study."""

from __future__ import annotations

from pathlib import Path

import pytest
from discovered import discovered
from hidden_machines import machine

from heatrun.model.catalogue import all_effects
from lptn import EFFECTS


@pytest.fixture(scope="module")
def cooled(hidden_bench):
    """It leaves a network without the effect 0.8 K off."""
    return machine(hidden_bench, ("speed_cooling",), 31, target_K=0.8)


@pytest.fixture(scope="module")
def named(cooled):
    """The staircase alone tells."""
    _, motor, (staircase, _), _ = cooled
    return discovered(motor, [staircase])


def value_of(found, effect, name):
    values = found.asked.search.engine.values(found.asked.core.z, 0)[0]
    return values[f"{effect}.{name}"]


def test_a_hidden_effect_is_named_with_its_amplitude(cooled, named):
    case, _, _, _ = cooled
    assert named.verdict.word == "named"
    assert named.asked.ids == ("speed_cooling",)
    # the machine's law is 1.5 a s^p with 0.65 < p < 0.85 behind a lag; at rated speed both agree
    g = value_of(named, "speed_cooling", "g")
    assert g == pytest.approx(1.5 * case.amplitudes["speed_cooling"], rel=0.15)
    assert not named.before.is_adequate
    assert named.after.is_adequate
    assert named.left_out_K[1] < named.left_out_K[0]


def test_the_gap_is_at_the_stator(named):
    assert "stator" in named.where_before.node
    spans = [span for span in named.where_before.spans if span.node == "stator"]
    assert spans
    for span in spans:
        low, high = span.interval_95
        assert low < span.missing < high
        assert low * high > 0.0  # significant spans only


def test_network_parameters_move_back_to_the_truth(cooled, named):
    case, _, _, _ = cooled
    before, after = (fit.values()["Req_sr"] for fit in named.asked.fits)
    assert abs(after / case.machine.Req_sr - 1.0) < 0.05
    assert abs(before / case.machine.Req_sr - 1.0) > 0.10


@pytest.mark.slow
def test_without_its_name_in_the_catalogue_the_cause_stays_unexplained(cooled):
    """Place and watts are there all the same."""
    _, motor, tests, _ = cooled
    kinds = [kind for kind in EFFECTS if kind.card.id != "speed_cooling"]
    found = discovered(motor, tests, kinds=kinds)
    assert found.verdict.word == "unexplained"
    assert "stator" in found.where_before.node


@pytest.mark.slow
def test_heat_from_outside_is_found_where_and_when_it_was(hidden_bench):
    """A heat step is in no catalogue: no name, but place, time and watts."""
    case, motor, tests, _ = machine(hidden_bench, ("unknown:heat_step",), 36, target_K=0.8)
    found = discovered(motor, tests)
    assert found.verdict.word == "unexplained"
    where = found.where_before
    assert "stator" in where.node
    added = case.tests[0].added_W
    inside = case.tests[0].columns["time_s"][added > 0]
    span = max((s for s in where.spans if s.node == "stator"), key=lambda s: s.missing)
    assert span.test == "test_1"
    # knots are two minutes apart, and a smooth course rounds off a step
    assert span.from_s == pytest.approx(inside[0], abs=500.0)
    assert span.to_s == pytest.approx(inside[-1], abs=500.0)
    assert 0.5 * added.max() < span.missing < 1.2 * added.max()


def test_on_a_clean_machine_nothing_is_claimed(hidden_bench):
    _, motor, (staircase, _), _ = machine(hidden_bench, (), 32)
    found = discovered(motor, [staircase])
    assert found.verdict.word == "adequate"
    assert not found.asked.core.effects
    assert found.asked.familywise_p > 0.05


@pytest.mark.slow
def test_a_single_load_step_cannot_tell(hidden_bench):
    _, motor, tests, _ = machine(hidden_bench, ("ac_copper_loss",), 33, kind="single_step")
    found = discovered(motor, tests)
    assert found.verdict.word == "not_identifiable"
    assert not found.asked.core.effects


@pytest.mark.slow
def test_a_users_effect_is_found_when_it_is_the_hidden_one(cooled):
    """Its one file stands in for what the catalogue would call speed cooling."""
    case, motor, tests, _ = cooled
    kinds = all_effects([Path(__file__).with_name("shaft_fan.py")])
    found = discovered(motor, tests, kinds=[k for k in kinds if k.card.id != "speed_cooling"])
    assert found.verdict.word == "named"
    assert found.asked.ids == ("shaft_fan",)
    g = value_of(found, "shaft_fan", "g")
    assert g == pytest.approx(1.5 * case.amplitudes["speed_cooling"], rel=0.15)
