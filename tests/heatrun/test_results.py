"""Results are types: one writer, one reader, and schemas that follow from them."""

import copy
import dataclasses
import json
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from heatrun.errors import InputError
from heatrun.record.record import Finding
from heatrun.results import DiscoveryResult, FitResult, from_json, to_json
from heatrun.results.discovery import CandidateFate
from heatrun.results.model import DerivedFigure, MissingSpan
from heatrun.results.schema import SCHEMAS, schema_of
from heatrun_fleet.results import SCHEMAS as SCHEMAS_OF_FLEETS

ALL_SCHEMAS = {**SCHEMAS, **SCHEMAS_OF_FLEETS}

STORED = Path(__file__).parents[1] / "stored"
"""Files as heatrun wrote them before its results were types (commit d93e2a8).

`fit-1.json`: `heatrun calibrate motor.toml duty_30min.csv.gz --holdout step_90min.csv.gz --model
both --quick --rating S2-30` on data/synthetic. `discovery-2.json`: a cooling step
in one of two tests, with a held-out test.
`population-1.json`: eight machines of two suppliers, one of which does not fit, and a refused one,
by `tests/fleet/rows_of_machines.py`; as heatrun wrote it first.
`fleet-discovery-1.json`: three types with drawn evidence, by `machines` of
`tests/fleet/test_shared_effects.py`: an effect, an instrument, too few; as heatrun wrote it first.
"""


def read(content, kind=FitResult):
    return from_json(json.dumps(content).encode(), kind, "fit.json", "run")


@pytest.fixture
def stored():
    return json.loads((STORED / "fit-1.json").read_text(encoding="utf-8"))


@pytest.fixture
def found():
    return json.loads((STORED / "discovery-2.json").read_text(encoding="utf-8"))


def violations(content, name="fit-1.json"):
    validator = jsonschema.Draft202012Validator(schema_of(name, ALL_SCHEMAS))
    return [error.message for error in validator.iter_errors(content)]


@pytest.mark.parametrize("name", ALL_SCHEMAS)
def test_the_schemas_are_those_of_the_types(name):
    schema = schema_of(name, ALL_SCHEMAS)
    jsonschema.Draft202012Validator.check_schema(schema)
    kind, _ = ALL_SCHEMAS[name]
    number = schema["properties"]["format"]["enum"][0].split("/")[1]
    assert name.endswith(f"-{number}.json")
    fields = {field.name for field in dataclasses.fields(kind)}
    assert set(schema["properties"]) == fields | {"run"}


@pytest.mark.parametrize("name", ALL_SCHEMAS)
def test_a_file_of_an_earlier_version_reads_and_writes_to_the_same_bytes(name):
    content = (STORED / name).read_bytes()
    kind, _ = ALL_SCHEMAS[name]
    assert to_json(from_json(content, kind, name, "run")).encode() + b"\n" == content
    assert violations(json.loads(content), name) == []
    assert violations({**json.loads(content), "run": "folder"}, name) == []


def test_a_fresh_calibration_holds_to_the_schema_and_reads_back(finished_day):
    text = (finished_day / "run" / "fit.json").read_text(encoding="utf-8")
    printed = json.loads((finished_day / "printed.json").read_text(encoding="utf-8"))
    assert violations(json.loads(text)) == violations(printed) == []
    again = from_json(text.encode(), FitResult, "fit.json", "run")
    assert to_json(again) == text.rstrip("\n")
    assert {**json.loads(text), "run": "run"} == printed
    said = [finding.id for finding in again.findings]
    assert said.count("current_scale_unchecked") == 1  # the duty never stands still under current


def test_what_a_later_version_adds_is_passed_over(stored):
    plain = read(stored)
    stored["new"] = 1
    stored["models"]["second"]["new"] = {"more": []}
    stored["tests"][0]["new"] = None
    assert read(stored) == plain


def test_what_an_earlier_version_lacked_has_a_default(stored):
    for test in stored["tests"]:
        del test["mapping"]
    for model in stored["models"].values():
        del model["title"], model["nodes"], model["effects"], model["evidence"]["aic"]
    found = read(stored)
    assert found.tests[0].mapping == ()
    assert found.models["second"].effects == ()


@pytest.mark.parametrize(
    ("spoil", "where"),
    [
        (lambda r: r.pop("seed"), "missing required field `seed`"),
        (lambda r: r.update(seed="0"), r"Expected `int`, got `str` - at `\$\.seed`"),
        (lambda r: r["motor"].update(sink="oil"), r"'oil' - at `\$\.motor\.sink`"),
        (lambda r: r["motor"].pop("name"), r"`name` - at `\$\.motor`"),
        (lambda r: r["tests"][1].update(role="seen"), r"'seen' - at `\$\.tests\[1\]\.role`"),
        (lambda r: r.update(tests=[]), r"at `\$\.tests`"),
        (lambda r: r.update(models={}), r"at `\$\.models`"),
        (
            lambda r: r["models"]["first"]["parameters"]["Ceq"].update(value=None),
            r"Expected `float`, got `null` - at `\$\.models\[\.\.\.\]\.parameters",
        ),
        (
            lambda r: r["models"]["first"]["residuals"][0].update(rmse_K=-1.0),
            r"residuals\[0\]\.rmse_K",
        ),
        (
            lambda r: r["models"]["second"]["derived"]["tau_fast_s"].update(refused="no"),
            r"`refused` alone - at `\$\.models\[\.\.\.\]\.derived",
        ),
    ],
)
def test_a_damaged_field_is_named_by_its_path_and_refused_by_the_schema(spoil, where, stored):
    spoil(stored)
    with pytest.raises(InputError, match=where) as refusal:
        read(stored)
    assert "fit.json of the run cannot be read" in str(refusal.value)
    assert violations(stored)


@pytest.mark.parametrize(
    ("spoil", "where"),
    [
        (lambda r: r.update(verdict="perhaps"), r"'perhaps' - at `\$\.verdict`"),
        (lambda r: r.pop("traces"), "missing required field `traces`"),
        (
            lambda r: r.update(traces=[{"id": "radiation", "closes_K": 0.1}]),
            r"at `\$\.traces\[0\]`",
        ),
        (lambda r: r["holdout"].pop("took_part_in_selection"), r"at `\$\.holdout`"),
        (
            lambda r: r["effects"][0]["parameters"]["k"].pop("unit"),
            r"`\$\.effects\[0\]\.parameters",
        ),
        (lambda r: r["effects"][0].update(parameters={}), r"`\$\.effects\[0\]\.parameters"),
        (lambda r: r["effects"][0].update(probability=1.5), r"effects\[0\]\.probability"),
        (lambda r: r["candidates"][0].update(status="unsure"), r"candidates\[0\]\.status"),
        (lambda r: r.update(candidates=[]), r"at `\$\.candidates`"),
        (lambda r: r["where"][0].update(interval_95=[1.0]), r"where\[0\]\.interval_95"),
        (lambda r: r["where"][0].update(missing_K=1.0), r"missing_W and missing_K.*where\[0\]"),
        (lambda r: r["calibration"].update(coverage_95_after=1.5), "coverage_95_after"),
        (lambda r: r["tests"][0]["before"].update(rmse_K=-1.0), r"tests\[0\]\.before\.rmse_K"),
        (lambda r: r["localisation"]["before"].pop("nodes"), r"localisation\.before"),
    ],
)
def test_a_damaged_discovery_is_refused_by_reader_and_schema(spoil, where, found):
    spoil(found)
    content = json.dumps(found).encode()
    with pytest.raises(InputError, match=where):
        from_json(content, DiscoveryResult, "discovery.json", "run")
    assert violations(found, "discovery-2.json")


@pytest.mark.parametrize(
    "spoil",
    [
        lambda r: r.update(unheard_of=1),
        lambda r: r.update(traces=[{"id": "radiation", "equivalents": [], "closes_K": 0.1,
                                    "delta_log_evidence": 12.0, "unheard_of": 1}]),
    ],
)  # fmt: skip
def test_a_field_unknown_to_this_version_reads_but_is_not_in_its_schema(spoil, found):
    spoil(found)
    from_json(json.dumps(found).encode(), DiscoveryResult, "discovery.json", "run")
    assert violations(found, "discovery-2.json")


@pytest.mark.parametrize(
    "content",
    [b"", b"{", b"\xff", b"[" * 100_000, b"[]", b"null", b'{"format": 1e999}', b'{"seed": 0}',
     b'{"format": "heatrun-fit/2"}', b'{"format": ["heatrun-fit/1"]}'],
)  # fmt: skip
def test_what_is_no_result_is_refused(content):
    with pytest.raises(InputError, match=r"fit\.json (of the run cannot be|is of another format)"):
        from_json(content, FitResult, "fit.json", "run")


def test_a_misspelt_field_is_an_error(stored):
    with pytest.raises(AttributeError):
        _ = read(stored).verdcit  # pyright: ignore[reportAttributeAccessIssue]
    with pytest.raises(dataclasses.FrozenInstanceError):
        read(stored).seed = 1  # pyright: ignore[reportAttributeAccessIssue]


def test_numbers_that_are_not_finite_are_null_and_read_back(stored):
    figure = DerivedFigure(
        value=float("inf"), unit="s", sd=float("nan"), interval_95=(1.0, float("inf")), condition=""
    )
    made = copy.deepcopy(read(stored))
    made.models["second"].derived["time_to_limit_cold_s"] = figure
    text = to_json(made)
    again = read(json.loads(text)).models["second"].derived["time_to_limit_cold_s"]
    assert (again.value, again.sd, again.interval_95) == (None, None, (1.0, None))
    assert np.isnan(again.median)
    assert violations(json.loads(text)) == []


def test_fields_that_are_unset_are_left_out():
    row = CandidateFate(id="radiation", status="not available", reason="no speed")
    assert json.loads(to_json(row)) == {
        "id": "radiation", "status": "not available", "reason": "no speed"
    }  # fmt: skip
    assert row.log_evidence is None
    span = MissingSpan(
        test="a", from_s=0.0, to_s=1.0, node="sensor", missing_K=0.5, interval_95=(0.4, 0.6)
    )
    assert list(json.loads(to_json(span)))[3:] == ["node", "missing_K", "interval_95"]
    assert span.missing == (0.5, "K")


@pytest.mark.parametrize("missing", [{}, {"missing_W": 1.0, "missing_K": 1.0}])
def test_a_span_misses_heat_or_reading_not_both_nor_none(missing):
    with pytest.raises(ValueError, match="one of missing_W and missing_K"):
        MissingSpan(test="a", from_s=0.0, to_s=1.0, node="x", interval_95=(0.0, 1.0), **missing)


def test_values_of_arrays_and_numpy_are_written_as_numbers():
    found = Finding("a", "note", "m", values={"n": np.int64(3), "x": np.float64("nan")})  # pyright: ignore[reportArgumentType]
    assert json.loads(to_json({"f": [found], "b": np.bool_(True), "m": np.eye(2)})) == {
        "f": [{"id": "a", "severity": "note", "message": "m", "where": "", "remedy": "", "test": "",
               "values": {"n": 3, "x": None}}],
        "b": True, "m": [[1.0, 0.0], [0.0, 1.0]],
    }  # fmt: skip


def test_a_network_that_the_tests_refuse_is_not_sampled(finished_day):
    """What decides is the evidence of the fits; the intervals are those of the normal law."""
    stored = json.loads((finished_day / "run" / "fit.json").read_text())
    first, second = (stored["models"][name] for name in ("first", "second"))
    assert stored["verdict"]["log_bayes_factor"] > 20.0
    assert (first["posterior"]["method"], second["posterior"]["method"]) == ("normal", "importance")
    assert first["posterior"]["verdict"].startswith("The tests refuse this network (log Bayes")
    assert not any(each["id"] == "sampling_not_converged" for each in stored["findings"])
    assert first["evidence"]["log_evidence"] == pytest.approx(
        second["evidence"]["log_evidence"] - stored["verdict"]["log_bayes_factor"]
    )
