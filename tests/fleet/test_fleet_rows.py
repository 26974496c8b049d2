"""The row of a machine: the fit's numbers, the machine's truth, and reasons where there is none."""

import json
import math
import re
import shutil
from pathlib import Path

import duckdb
import numpy as np
import pytest
from simulated_fleet import bench_file, calibrated, machine_of, planned

import heatrun
from heatrun.calibration import load_tests
from heatrun.fit.fit import fit
from heatrun.model.model import Model
from heatrun.model.problem import Problem
from heatrun.motor.file import load_motor
from heatrun_fleet.entries import COLUMNS as OF_A_TABLE
from heatrun_fleet.fleet_file import KEYS
from heatrun_fleet.machine import Prepared, prepare
from heatrun_fleet.population.table import COLUMNS as OF_A_POPULATION
from heatrun_fleet.rows import COLUMNS, read_part, schema

FAR = 4.0
"""Standard deviations; beyond it lie 6 in 100 000, and 24 numbers are looked at."""


def rows_of(path):
    return read_part(path / "machines.parquet").to_pylist()


def test_rows_hold_the_truth_within_their_intervals(finished):
    rows = rows_of(finished / "out")
    assert [row["machine"] for row in rows] == [f"M{n:03d}" for n in range(6)]
    for number, row in enumerate(rows):
        assert (row["status"], row["is_converged"]) == ("fitted", True)
        assert row["transforms"] == ["log"] * 4
        covariance = np.array(row["log_covariance"]).reshape(4, 4)
        truth = machine_of(number)
        error = np.array(row["log_mean"]) - [math.log(truth[n]) for n in row["parameters"]]
        assert np.all(np.abs(error) < FAR * np.sqrt(np.diag(covariance)))
        assert np.array_equal(covariance, covariance.T)
        assert np.all(np.linalg.eigvalsh(covariance) > 0.0)
        # the tests say more than the prior does: their own precision is positive
        own = np.linalg.inv(covariance) - np.diag(np.array(row["prior_sd"]) ** -2.0)
        assert np.all(np.linalg.eigvalsh(own) > 0.0)
        assert row["rmse_K"] < 0.2
        assert dict(row["covariates"])["supplier"] == ("north" if number % 2 else "south")


def test_a_row_is_the_single_fit(finished):
    row = rows_of(finished / "out")[2]
    motor = load_motor(finished / "bench" / "motor.toml")
    tests = [t.blocks for t in load_tests(motor, [finished / "bench" / "tests" / "M002.csv"])]
    model = Model.of("second", motor).scaled(motor, tests)
    single = fit(Problem.of(model, motor, [model.with_bodies(rows) for rows in tests]))
    assert (
        dict(zip(row["parameters"], row["parameter_values"], strict=True)).items()
        <= dict(single.values()).items()
    )
    assert row["log_evidence"] == single.log_evidence
    places = [i for i, slot in enumerate(single.slots) if slot.parameter.role == "network"]
    sd = [single.slots[i].parameter.sd for i in places]
    expected = np.outer(sd, sd) * single.covariance[np.ix_(places, places)]
    found = np.array(row["log_covariance"]).reshape(4, 4)
    # the row's is made symmetric to the last bit
    assert np.max(np.abs(found / expected - 1.0)) < 1e-6


def test_the_schema_says_units_and_meanings():
    for name, _, unit, meaning in COLUMNS:
        said = schema().field(name).metadata
        assert said[b"meaning"].decode() == meaning
        assert said.get(b"unit", b"").decode() == unit


GARBAGE = bytes(range(256)) * 40


def kelvin(text):
    lines = text.splitlines()
    rows = [line.rpartition(",") for line in lines[1:]]
    return "\n".join([lines[0], *(f"{a},{float(t) + 273.15}" for a, _, t in rows)]) + "\n"


def test_bad_machines_are_named_and_kept_apart(finished, bench, tmp_path):
    tests = bench / "tests"
    good = (bench / "machines.csv").read_text().splitlines()[:3]
    (tests / "garbage.csv").write_bytes(GARBAGE)
    (tests / "kelvin.csv").write_text(kelvin((tests / "M000.csv").read_text()))
    (tests / "copy.csv").write_text((tests / "M001.csv").read_text())
    (bench / "broken.toml").write_text("[motor]\nnane = 3\n")
    rows = [
        "machine,type,test,supplier,date,motor",
        *(f"{row}," for row in good[1:]),
        "B_gone,A,tests/gone.csv,,,",
        "B_garbage,A,tests/garbage.csv,,,",
        "B_kelvin,A,tests/kelvin.csv,,,",
        "B_motor,A,tests/M002.csv,,,broken.toml",
        "B_no_motor,A,tests/M003.csv,,,gone.toml",
        "B_role,A,tests/copy.csv,,,,surplus",
        "B_stretch,A,tests/M004.csv@9h..10h,,,",
    ]
    (bench / "machines.csv").write_text("\n".join(rows) + "\n")
    result = calibrated(bench, tmp_path / "out")
    found = {row["machine"]: row for row in rows_of(tmp_path / "out")}
    assert result.manifest["machines"] == {"all": 9, "fitted": 2, "refused": 7}
    expected = {
        "B_gone": "missing_file", "B_garbage": "input_error", "B_kelvin": "units_temperature",
        "B_motor": "input_error", "B_no_motor": "missing_file", "B_role": "bad_row",
        "B_stretch": "input_error",
    }  # fmt: skip
    for machine, id in expected.items():
        findings = json.loads(found[machine]["findings"])
        errors = [each for each in findings if each["severity"] == "error"]
        assert found[machine]["status"] == "refused"
        assert id in [each["id"] for each in errors], (machine, errors)
        assert all(each["remedy"] for each in errors)
        assert str(bench) not in found[machine]["findings"]
        assert found[machine]["parameter_values"] == []
    undisturbed = {row["machine"]: row for row in rows_of(finished / "out")}
    assert found["M000"] == undisturbed["M000"]
    # M001's test lies there a second time, under another machine's name
    own = json.loads(found["M001"]["findings"])
    assert "B_role" in next(each["message"] for each in own if each["id"] == "test_of_another")
    assert found["M001"]["parameter_values"] == undisturbed["M001"]["parameter_values"]


def test_rows_of_one_machine_become_one_problem(bench):
    rows = ["machine,test,role", "M1,tests/M000.csv,", "M1,tests/M001.csv,", "M1,tests/M002.csv,"]
    (bench / "machines.csv").write_text("\n".join([*rows[:3], f"{rows[3]}holdout"]) + "\n")
    (batch,) = planned(bench, 16)
    ready = prepare(batch.entries[0], batch)
    assert isinstance(ready, Prepared)
    assert [test.name for test in ready.problem.tests] == ["M000", "M001"]
    assert [name for name, _ in ready.holdout] == ["M002"]
    assert ready.duration_s == pytest.approx(2 * 1198.0)
    assert [each["role"] for each in ready.inputs] == [
        "motor", "calibration", "calibration", "holdout",
    ]  # fmt: skip


@pytest.mark.slow
def test_held_out_tests_are_predicted(bench, tmp_path):
    (bench / "tests" / "other.csv").write_text(bench_file(machine_of(0), seed=50, minutes=20.0))
    text = "machine,test,holdout\nM000,tests/M000.csv,tests/other.csv\n"
    (bench / "machines.csv").write_text(text)
    calibrated(bench, tmp_path / "out")
    (row,) = rows_of(tmp_path / "out")
    assert row["holdout_tests"] == ["other"]
    # 0.1 K of noise a sample, and parameters that 20 min leave open
    assert row["holdout_rmse_K"][0] < 1.0
    assert row["holdout_coverage_95"][0] > 0.7


PAGE = (Path(__file__).parents[2] / "docs" / "fleet.md").read_text("utf-8")


@pytest.mark.parametrize("columns", [COLUMNS, OF_A_POPULATION], ids=["fleet", "population"])
def test_the_page_lists_every_column_of_the_rows(columns):
    expected = [
        f"| `{name}` | {kind} | {unit} | {meaning} |" for name, kind, unit, meaning in columns
    ]
    start = PAGE.index(expected[0])
    assert PAGE[start:].splitlines()[: len(expected)] == expected


def test_the_page_says_every_key_and_column_of_the_fleet_file():
    assert all(re.search(rf"^    {key} = ", PAGE, re.M) for key in KEYS)
    assert all(f"`{name}`" in PAGE for name in OF_A_TABLE)


def test_the_queries_run(finished, tmp_path, monkeypatch):
    shutil.copy(finished / "out" / "machines.parquet", tmp_path)
    heatrun.population(finished / "out", out=tmp_path)
    monkeypatch.chdir(tmp_path)
    queries = re.findall(r"^    (select .*?);$", PAGE, re.M | re.S)
    assert len(queries) == 7
    for query in queries:
        duckdb.sql(query).fetchall()
