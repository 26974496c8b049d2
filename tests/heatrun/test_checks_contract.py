"""Each check keeps silent on a clean heat run and finds its own fault where it was put."""

from __future__ import annotations

import numpy as np
import pytest
from faults_of_records import FAULTS, VARIANTS
from heat_runs import CLEAN, MOTOR, SMOOTH, heat_run, named

from heatrun.checks import CHECKS, check_record


@pytest.mark.parametrize(
    "record",
    [
        CLEAN,
        SMOOTH,
        heat_run(1, 30.0),
        heat_run(2, 90.0, step_s=0.5),
        heat_run(3, 90.0, currents=(150.0, 100.0, 0.0), step_s=0.5),
    ],
    ids=["60 min", "unrounded", "30 min", "90 min", "cool-down"],
)
def test_clean_heat_run_gives_notes_only(record):
    doubts = [f.sentence() for f in check_record(record, MOTOR) if f.severity != "note"]
    assert doubts == []


def test_every_check_has_its_fault():
    assert {check.__name__ for check in CHECKS} == set(FAULTS)


@pytest.mark.parametrize("id", list(FAULTS))
def test_each_check_finds_its_own_fault(id):
    record, motor, severity, key, (low, high) = FAULTS[id]
    found = named(check_record(record, motor), id)
    assert [f.severity for f in found if f.severity == severity], found
    finding = next(f for f in found if f.severity == severity)
    assert finding.test == "run"
    assert "run" in finding.where
    if severity != "note":
        assert finding.remedy.endswith((".", "?"))
    if key:
        assert low <= finding.values[key] <= high
    assert all(np.isfinite(list(finding.values.values())))


@pytest.mark.parametrize("name", list(VARIANTS))
def test_the_same_fault_in_another_form(name):
    id, record, motor, severity = VARIANTS[name]
    severities = {f.severity for f in named(check_record(record, motor), id)}
    assert severities == ({severity} if severity else set())
