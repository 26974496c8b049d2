"""Equivalent effects come out equal, and a poor start is not reported as physics."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hidden_machines import machine

from heatrun.discovery.grow import look, refitted
from heatrun.discovery.judging.refits import refit_with
from heatrun.discovery.screening.engine import Engine
from heatrun.discovery.screening.library import library
from heatrun.discovery.screening.start import base_start
from heatrun.inference.model import Model
from heatrun.inference.problem import Problem
from lptn import EFFECTS

EQUIVALENT = ("neighbour_body", "housing_node")
"""Seen from the winding a housing is exactly a body beside the stator: see `HousingNode`."""

NATS = 3.0
"""Their priors of capacity and share differ, by less than what counts as a tie [nat]."""


@pytest.fixture(scope="module")
def searched(hidden_bench):
    """A machine with a slow body beside the stator, as the discovery sees it in its first round."""
    _, motor, tests, _ = machine(hidden_bench, ("neighbour_body",), 1330, target_K=0.2)
    bare = Model.of("second", motor)
    kinds = [kind for kind in EFFECTS if kind.card.id in (*EQUIVALENT, "radiation", "sensor_lag")]
    found = library(kinds, bare.topology(), tests)
    engine = Engine(Problem.of(replace(bare, effects=found.kinds), motor, tests, found.kinds))
    start = base_start(engine)
    screen, _ = look(engine, engine.refit(start.z, engine.base, start.noise), found.candidates)
    return engine, screen.present, {score.candidate.id: score for score in screen.scores()}


def test_equivalent_effects_come_out_equal(searched):
    engine, present, scores = searched
    body, housing = (refitted(engine, present, present, scores[name]) for name in EQUIVALENT)
    assert body.delta_log_evidence > 100.0
    assert housing.delta_log_evidence == pytest.approx(body.delta_log_evidence, abs=NATS)
    assert housing.gap_K == pytest.approx(body.gap_K, rel=0.01)
    # neither is refused: capacity and time constant go together, each alone has a wide interval
    assert body.reason == housing.reason == ""


@pytest.mark.parametrize("name", EQUIVALENT)
def test_a_start_at_the_null_does_not_hold_a_refit_there(name, searched):
    engine, present, scores = searched
    good = refit_with(engine, present, scores[name])
    amplitude, shape = list(scores[name].start)
    poor = replace(scores[name], start={amplitude: 0.0, shape: -1.5})
    found = refit_with(engine, present, poor)
    assert found.log_evidence == pytest.approx(good.log_evidence, abs=0.5)
