"""`discovery.json` is what its schema says, and the schema refuses what it is not."""

from __future__ import annotations

import copy
import json

import jsonschema
import pandas as pd
import pytest

from heatrun.cli import main
from heatrun.results.discovery import DISCOVERY_FORMAT
from heatrun.results.schema import schema_of

pytestmark = pytest.mark.slow

SCHEMA = schema_of("discovery-2.json")
VALIDATOR = jsonschema.Draft202012Validator(SCHEMA)


@pytest.fixture(scope="module")
def result(hidden_bench, tmp_path_factory):
    """A discovery with an event in one test of two, a held-out test, and every part filled."""
    case = hidden_bench.make_case(
        ("cooling_step",), 4000, target_K=0.8, only_test=1, resolution_K=0.1
    )
    folder = tmp_path_factory.mktemp("schema")
    machine = case.machine
    (folder / "motor.toml").write_text(
        f'[motor]\nname = "study"\nlosses = "{case.losses}"\n'
        f"rated_speed_rpm = {machine.rated_speed_rpm:.2f}\n[winding]\n"
        f"phase_resistance_ohm = {machine.phase_resistance_ohm:.6g}\n",
        encoding="utf-8",
    )
    for test in case.tests:
        path = folder / f"{test.name}.csv"
        pd.DataFrame(test.columns).to_csv(path, index=False, float_format="%.6g")
    first, second, held_out = (str(folder / f"{test.name}.csv") for test in case.tests)
    run = folder / "run"
    words = [first, second, "--holdout", held_out, "--quick", "--out", str(run)]
    assert main(["discover", str(folder / "motor.toml"), *words]) == 0
    return json.loads((run / "discovery.json").read_text(encoding="utf-8"))


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
