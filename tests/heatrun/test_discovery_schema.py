"""`discovery.json` is what its shipped schema says, and the schema refuses what it is not."""

from __future__ import annotations

import copy
import json

import jsonschema
import pytest
from hidden_machines import machine

from heatrun.results import to_json
from heatrun.results.discovery import DISCOVERY_FORMAT
from heatrun.results.schema import shipped

pytestmark = pytest.mark.slow

SCHEMA = shipped("discovery-2.json")
VALIDATOR = jsonschema.Draft202012Validator(SCHEMA)


@pytest.fixture(scope="module")
def result(hidden_bench):
    """A discovery with an event in one test of two, a held-out test, and every part filled."""
    from heatrun.discovery.result import assemble
    from heatrun.discovery.run import discover, show

    case, motor, _, tests = machine(
        hidden_bench, ("cooling_step",), 4000, target_K=0.8, only_test=1
    )
    found = discover(motor, tests[:2], held_out=tests[2:])
    shown = show(found, tests, method="quick")
    roles = [test.role for test in case.tests]
    return json.loads(to_json(assemble(found, shown, roles, command="test", seed=0)))


def test_the_schema_is_one():
    jsonschema.Draft202012Validator.check_schema(SCHEMA)
    assert SCHEMA["properties"]["format"]["enum"] == [DISCOVERY_FORMAT]


def test_a_result_holds_to_the_schema(result):
    assert [error.message for error in VALIDATOR.iter_errors(result)] == []
    assert [error.message for error in VALIDATOR.iter_errors({**result, "run": "folder"})] == []
    (effect,) = result["effects"]
    assert (effect["id"], effect["test"]) == ("cooling_step", "test_2")
    assert set(result) == set(SCHEMA["required"]), "a field that the schema does not know of"


@pytest.mark.parametrize(
    "spoil",
    [
        lambda r: r.update(format="heatrun-discovery/1"),
        lambda r: r.update(verdict="perhaps"),
        lambda r: r.pop("traces"),
        lambda r: r.update(traces=[{"id": "radiation", "closes_K": 0.1}]),
        lambda r: r["holdout"].pop("took_part_in_selection"),
        lambda r: r["effects"][0]["parameters"]["k"].pop("unit"),
        lambda r: r["candidates"][0].update(status="unsure"),
        lambda r: r["where"][0].update(interval_95=[1.0]),
        lambda r: r.update(unheard_of=1),
    ],
)
def test_what_is_no_result_is_refused(spoil, result):
    spoiled = copy.deepcopy(result)
    spoil(spoiled)
    assert not VALIDATOR.is_valid(spoiled)
