"""A record from a file: its time, its rate, what is not recorded, and measured benches."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from heatrun.errors import InputError
from heatrun.readers.channel_map import require
from heatrun.readers.read import read_record
from heatrun.record.motor import Motor

BENCH = Path(__file__).parents[3] / "shared" / "bench"
needs_bench = pytest.mark.skipif(not BENCH.is_dir(), reason="measured records are not here")
CONTROLLER = "Voltage (V),Current (A),Temperature (C),eRPM,Motor Duty,Phase Current (A),Power (W)"


def write(tmp_path: Path, header: str, *rows: str) -> Path:
    path = tmp_path / "run.csv"
    path.write_text("\n".join([header, *rows]) + "\n")
    return path


def test_a_phase_current_of_zeros_is_not_recorded(tmp_path):
    path = write(tmp_path, CONTROLLER, "60,2,24,900,3,0,120", "60,3,25,950,3,0,180")
    record = read_record(path, rate_Hz=10)
    assert set(record.channels) == {
        *("time_s", "dc_voltage_V", "dc_current_A", "dc_power_W", "controller_degC")
    }
    assert [finding.id for finding in record.findings] == ["not_recorded"]
    assert any("eRPM" in note and "electrical" in note for note in record.notes)
    measured = write(tmp_path, CONTROLLER, "60,2,24,900,3,0,120", "60,3,25,950,3,7,180")
    assert read_record(measured, rate_Hz=10)["phase_current_A"].tolist() == [0.0, 7.0]
    asked = Motor("M", columns={"phase_current_A": "Phase Current"})
    path = write(tmp_path, CONTROLLER, "60,2,24,900,3,0,120", "60,3,25,950,3,0,180")
    assert read_record(path, asked, rate_Hz=10)["phase_current_A"].tolist() == [0.0, 0.0]


def test_a_file_without_time_needs_a_rate(tmp_path):
    path = write(tmp_path, "winding_degC,P", "20,1", "21,2", "22,3")
    with pytest.raises(InputError, match="no time column") as caught:
        read_record(path)
    assert 'time_s = "rate 10 Hz"' in caught.value.remedy
    assert read_record(path, rate_Hz=4).time_s.tolist() == [0.0, 0.25, 0.5]
    motor = Motor("M", columns={"time_s": "rate 10 Hz"})
    assert read_record(path, motor).time_s.tolist() == [0.0, 0.1, 0.2]
    for rate in (0.0, -1.0, float("nan")):
        with pytest.raises(InputError, match="above 0 Hz"):
            read_record(path, rate_Hz=rate)


def test_a_rate_never_replaces_a_measured_time(tmp_path):
    path = write(tmp_path, "time_s,winding_degC", "0,20", "2,21")
    with pytest.raises(InputError, match="has a time column"):
        read_record(path, rate_Hz=10)
    record = read_record(path, Motor("M", columns={"time_s": "rate 10 Hz"}))
    assert record.time_s.tolist() == [0.0, 2.0]
    assert any("rate in [columns] is not used" in note for note in record.notes)


def test_the_record_of_a_plain_file(tmp_path):
    header = "phase_current_A,time_s,winding_degC,spare"
    path = write(tmp_path, header, "1,5,20,7", ",4,nan,7", "3,6.5,x,7", "4,7,22,7", "5,8,23,7")
    record = read_record(path)
    assert next(iter(record.channels)) == "time_s"
    assert record.time_s.tolist() == [0.0, -1.0, 1.5, 2.0, 3.0]  # backwards stays
    assert np.isnan(record["winding_degC"]).tolist() == [False, True, True, False, False]
    assert record.unused == ("spare",)
    assert any("at 5 s in the file" in note for note in record.notes)
    assert [(finding.id, finding.test) for finding in record.findings] == [
        ("unreadable_cells", "run")
    ]
    (source,) = record.sources
    assert len(source.sha256) == 64
    assert all(values.dtype == np.float64 for values in record.channels.values())
    assert read_record(path, name="first").name == "first"


def test_a_time_column_without_times_is_refused(tmp_path):
    path = write(tmp_path, "time_s,winding_degC,P", "nan,20,1", "nan,21,2")
    with pytest.raises(InputError, match="time"):
        read_record(path)


def test_what_a_fit_needs_is_named(tmp_path):
    record = read_record(write(tmp_path, "time_s,winding_degC,Pv", "0,20,1", "1,21,2"))
    with pytest.raises(InputError, match="Missing: phase_current_A") as caught:
        require(record)
    assert "not used: Pv" in caught.value.problem
    assert '[columns] phase_current_A = "COLUMN [A]"' in caught.value.remedy
    require(record, ["time_s", "winding_degC"])


@needs_bench
def test_measured_car_motor():
    record = read_record(BENCH / "paderborn_profile24_heatrun_2p5s.csv.gz")
    require(record)
    assert record.name == "paderborn_profile24_heatrun_2p5s"
    assert record.unused == ()
    assert record.time_s.size == 3003
    loaded = (record.time_s > 2000) & (record.time_s < 4300)
    unloaded = record.time_s > 5000
    # The README beside the file: 3.3 to 3.7 kW loaded, "1.5 kW" (two digits) unloaded
    assert 3300 < np.median(record["losses_W"][loaded]) < 3700
    assert 1400 < np.median(record["losses_W"][unloaded]) < 1650


@needs_bench
@pytest.mark.parametrize("run", ["Run2-Throttle100", "Run3-Throttle48", "Run13-Throttle8"])
def test_measured_small_motor(run):
    (logger,) = (BENCH / "tass" / run).glob("DAQ_*.csv")
    (controller,) = (BENCH / "tass" / run).glob("Export_*.csv")
    temperatures = read_record(logger)
    assert set(temperatures.channels) == {"time_s", "winding_degC", "stator_degC", "ambient_degC"}
    (count,) = (note for note in temperatures.notes if "Sample Count" in note)
    assert temperatures.time_s.size == int(count.split()[-1])
    assert (np.diff(temperatures.time_s) > 0).all()
    assert temperatures.findings == ()
    with pytest.raises(InputError, match="no time column"):
        read_record(controller)
    power = read_record(controller, rate_Hz=10)
    assert "phase_current_A" not in power
    assert np.median(power["dc_power_W"]) > 0
