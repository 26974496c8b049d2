"""An effect that is there and does not matter is told by name."""

from __future__ import annotations

import pytest
from hidden_machines import machine

from heatrun.discovery.judging.acceptance import RELEVANT_K
from heatrun.discovery.result import describe_trace
from heatrun.discovery.run import discover

pytestmark = pytest.mark.slow


def found_on(hidden_bench, hidden, seed, target_K):
    _, motor, tests, _ = machine(hidden_bench, hidden, seed, target_K=target_K)
    return discover(motor, tests)


@pytest.mark.parametrize(("effect", "seed"), [("natural_convection", 2003), ("radiation", 2004)])
def test_a_trace_is_named_and_the_verdict_stays_adequate(effect, seed, hidden_bench):
    found = found_on(hidden_bench, (effect,), seed, 0.1)
    assert found.verdict.word == "adequate"
    assert not found.named
    (trace,) = found.traces
    told = describe_trace(trace)
    assert effect in (told.id, *told.equivalents)
    assert 0.0 < told.closes_K < RELEVANT_K
    assert told.delta_log_evidence > 10.0
    assert told.id in found.verdict.sentence
    assert "too small to matter" in found.verdict.sentence
