"""Bundled records, and measured ones where they are at hand, are not asked about."""

from __future__ import annotations

from pathlib import Path

import pytest
from test_units_by_physics import checked

from heatrun.motor.file import load_motor
from heatrun.readers.align import join
from heatrun.readers.read import read_record
from heatrun.record.motor import Motor

DATA = Path(__file__).parents[2] / "data" / "synthetic"
SHARED = Path(__file__).resolve().parents[3] / "shared" / "bench"
BUNDLED = sorted(p.relative_to(DATA) for p in DATA.rglob("*.csv.gz"))
MEASURED = pytest.mark.skipif(not SHARED.is_dir(), reason="the measured records are not here")


def asked(record, motor):
    return [finding.sentence() for finding in checked(record, motor, "unit_suspected")]


@pytest.mark.parametrize("name", BUNDLED, ids=str)
def test_a_bundled_record_is_not_asked_about(name):
    path = DATA / name
    motor = load_motor(path.with_name("motor.toml"))
    assert asked(read_record(path, motor), motor) == []


@MEASURED
@pytest.mark.parametrize("sink", ["coolant", "ambient"])
@pytest.mark.parametrize("resistance", [None, 0.0125])
def test_a_measured_traction_motor_is_not_asked_about(sink, resistance):
    motor = Motor("traction", sink=sink, phase_resistance_ohm=resistance)
    (path,) = SHARED.glob("paderborn*")
    assert asked(read_record(path, motor), motor) == []


@MEASURED
@pytest.mark.parametrize("run", ["Run3", "Run13"])
def test_a_measured_small_motor_is_not_asked_about(run):
    (folder,) = (SHARED / "tass").glob(f"{run}-*")
    (thermometer,), (drive,) = folder.glob("DAQ*.csv"), folder.glob("Export*.csv")
    # the power from the link stands for the losses: the propeller was off
    columns = {"time_s": "rate 10 Hz", "losses_W": "Power [W]"}
    motor = Motor("small", columns=columns)
    joined, _ = join(read_record(thermometer, Motor("small")), read_record(drive, motor))
    assert asked(joined, motor) == []
