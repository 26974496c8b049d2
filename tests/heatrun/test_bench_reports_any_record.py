"""Whatever a record holds, it ends in a report or in an error of ours."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from heatrun.errors import InputError
from heatrun.record.channels import CHANNELS
from heatrun.record.motor import Motor
from heatrun.record.record import Record
from heatrun.results import to_json
from heatrun_reports import TEST_TYPES, Reference, build_report, make_report
from heatrun_reports.content import report_content
from heatrun_reports.csv_table import csv_table
from heatrun_reports.document import document_content

NAMES = [channel.name for channel in CHANNELS if channel.name != "time_s"]
MOTORS = (
    Motor("car", phase_resistance_ohm=0.006, gear_ratio=9.0, wheel_radius_m=0.3),
    Motor("bare"),
    Motor("cooled", sink="coolant", losses="map", phase_resistance_ohm=0.006),
)
BENCH = Path(__file__).parents[3] / "shared" / "bench" / "paderborn_profile24_heatrun_2p5s.csv.gz"


def course(rng: np.random.Generator, size: int) -> np.ndarray:
    """A walk, a constant, nothing, or a walk with holes, overflow or one sign."""
    values = np.cumsum(rng.standard_normal(size)) * 10.0 ** rng.uniform(-3.0, 5.0)
    return [
        values,
        np.zeros(size),
        np.full(size, values[-1]),
        np.full(size, np.nan),
        np.where(rng.random(size) < 0.3, np.nan, values),
        np.where(rng.random(size) < 0.1, np.inf, values),
        -np.abs(values),
    ][rng.integers(7)]


def any_record(rng: np.random.Generator) -> Record:
    size = int(rng.choice([1, 2, 3, 12, 200, 1500]))
    time_s = np.arange(size) * rng.choice([0.1, 1.0, 30.0])
    kind, middle = rng.integers(5), size // 2
    if kind == 0:
        time_s = np.where(np.arange(size) >= middle, time_s + 1e4, time_s)  # a gap
    elif kind == 1:
        time_s = np.where(np.arange(size) == middle, time_s[0] - 5.0, time_s)  # back in time
    elif kind == 2:
        time_s = np.where(rng.random(size) < 0.1, np.nan, time_s)
    channels = rng.choice(NAMES, rng.integers(0, 12), replace=False)
    return Record("any", {"time_s": time_s, **{str(c): course(rng, size) for c in channels}})


def kinds_reported(seed):
    """Build the reports of a random record; return the types that gave one."""
    made, refusals = [], []
    rng = np.random.default_rng(seed)
    record, motor = any_record(rng), MOTORS[seed % 3]
    moved = {**record.channels, "time_s": record.time_s + 7.0}
    other = any_record(rng) if seed % 2 else Record("moved", moved)
    for kind, card in TEST_TYPES.items():
        try:
            report = build_report(
                kind, motor, record, reference=Reference(other) if card.needs_reference else None
            )
        except InputError as error:
            refusals.append(error)
            continue
        made.append(kind)
        for drawing in report.drawings[:3]:
            assert drawing.draw().axes
        content = report_content(report, None)
        assert "NaN" not in to_json(content)
        assert document_content(report, content)["rows"] is not None
        assert ",nan," not in csv_table(report)
    # where the motor file lacks something, it is named
    named = ("any", motor.name)
    assert all(any(n in one.where for n in named) and one.remedy for one in refusals)
    return made


def test_any_record_ends_in_reports_or_in_errors_of_ours():
    made = Counter(kind for seed in range(16) for kind in kinds_reported(seed))
    # 16 records: a general report of each that holds speed or none, hardly an energy report of any
    assert made["general"] >= 12
    assert set(made) == set(TEST_TYPES)


@pytest.mark.skipif(not BENCH.exists(), reason="the measured bench records are not here")
def test_a_measured_record_gives_its_reports(tmp_path):
    motor = Motor(
        "PMSM", sink="coolant", phase_resistance_ohm=0.0146, reference_temperature_degC=70.0,
        gear_ratio=9.1, wheel_radius_m=0.3,
    )  # fmt: skip
    for kind in ("general", "energy", "thermal"):
        (outcome,) = make_report(kind, motor, [BENCH], tmp_path)
        assert outcome.error is None
        rows = {row["name"]: row["value"] for row in json.loads(outcome.json.read_text())["table"]}
        if kind == "energy":
            # 73 min of 64 Nm at 5500 rpm are 44.9 kWh at the shaft; losses of 1.5 to 3.7 kW
            assert rows["energy_kWh"] == pytest.approx(44.9 + 5.7, abs=1.0)
            assert 88.0 < rows["efficiency_motor_percent"] < 95.0
