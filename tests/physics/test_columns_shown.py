"""How each column was read is said wherever a result is: terminal, JSON, sheet and live view."""

import json

import numpy as np
import pytest
from bench_machines import SERVO, bench_record

from heatrun import cli
from heatrun.readers.mapping import (
    LONGEST,
    ReadColumns,
    describe_columns,
    grouped,
    mapping_rows,
    mapping_text,
)
from heatrun.readers.read import read_record
from heatrun.record.record import ColumnReading
from heatrun_view.reading import Reader
from heatrun_view.store import RecordStore

MOTOR = f"""
[motor]
name = "servo"
[winding]
phase_resistance_ohm = {SERVO.resistance}
"""

# (name in the file, channel, divided by)
COLUMNS = (
    ("t", "time_s", 1.0),
    ("phase_current_A", "phase_current_A", 1.0),
    ("electrical_power [kW]", "electrical_power_W", 1e3),
    ("speed_rpm", "speed_rpm", 1.0),
    ("torque_Nm", "torque_Nm", 1.0),
    ("ambient_degC", "ambient_degC", 1.0),
    ("winding_degC", "winding_degC", 1.0),
)


@pytest.fixture
def bench(tmp_path):
    """Write a test with some units stated, some in names and one nowhere; return how to."""
    (tmp_path / "motor.toml").write_text(MOTOR)

    def write(name="duty.csv", time_factor=1.0):
        channels = bench_record(SERVO, "steps")
        values = [channels[channel][::4] / divisor for _, channel, divisor in COLUMNS]
        values[0] = values[0] * time_factor
        head = ",".join(name for name, _, _ in COLUMNS)
        np.savetxt(tmp_path / name, np.stack(values, axis=1), "%.7g", ",", header=head, comments="")
        return tmp_path / name

    return write


def check(path, capsys, *options):
    code = cli.main(["check", str(path.with_name("motor.toml")), str(path), *options])
    return code, capsys.readouterr().out


def test_check_prints_the_columns_and_marks_what_was_assumed(bench, capsys):
    assert "ASSUMED" not in check(bench(), capsys)[1]
    code, out = check(bench(), capsys, "-v")
    lines = {line.split()[0]: line.split() for line in out.splitlines() if line.startswith("  ")}
    assert code == 0
    assert lines["time_s"][1:4] == ["t", "s", "ASSUMED"]
    assert lines["electrical_power_W"][3:5] == ["kW", "stated"]
    assert "the name" in out
    assert "electrical_power_W - torque·omega" in out
    assert "Unit assumed for time_s: " in out


def test_check_as_json_keeps_its_findings_and_adds_the_columns(bench, capsys):
    _, out = check(bench(), capsys, "--json")
    said = json.loads(out)
    assert {"findings", "tests", "unclaimed", "suitability", "next"} == set(said)
    (test,) = said["tests"]
    rows = {row["channel"]: row for row in test["mapping"]}
    assert rows["time_s"]["unit_from"] == "assumed"
    assert rows["electrical_power_W"]["unit"] == "kW"
    assert rows["electrical_power_W"]["unit_from"] == "stated"
    assert rows["speed_rpm"]["unit_from"] == "name"
    assert rows["losses_W"]["unit_from"] == "derived"
    assert [f["id"] for f in said["findings"]].count("unit_assumed") == 1


def test_minutes_are_asked_about_and_the_line_that_is_offered_settles_it(bench, capsys):
    path = bench(time_factor=1.0 / 60.0)
    code, out = check(path, capsys)
    assert code == 1
    assert 'time_s = "t [min]"' in out
    motor = path.with_name("motor.toml")
    motor.write_text(f'{MOTOR}[columns]\ntime_s = "t [min]"\n')
    code, out = check(path, capsys)
    assert code == 0
    assert "unit_suspected" not in out
    # and who insists on seconds may
    motor.write_text(f'{MOTOR}[columns]\ntime_s = "t [s]"\n')
    _, out = check(path, capsys)
    assert "warning" in next(line for line in out.splitlines() if "unit_suspected" in line)


def test_tests_that_were_read_alike_share_a_table(bench):
    one, two = (read_record(bench(name)) for name in ("one.csv", "two.csv"))
    tests = [describe_columns(one), describe_columns(two)]
    ((names, _),) = grouped(tests)
    assert names == "one, two"
    assert mapping_text(tests).count("Columns of") == 1
    assert mapping_text([ReadColumns("old", [])]) == ""


def test_a_long_name_keeps_its_beginning_and_its_end():
    name = "Messstelle_Pruefstand_3_Halle_7_Kanal_0042_Wicklung"
    row = ColumnReading("winding_degC", name, "degC", "stated", "[columns]", "a.csv")
    ((_, shown, *_),) = mapping_rows([row])
    assert len(shown) == LONGEST
    assert shown.startswith("Messstelle")
    assert shown.endswith("Wicklung")


def test_the_live_view_shows_the_columns(bench):
    path = bench()
    reader = Reader(path.with_name, RecordStore(), lambda opened: opened.open("rb"))
    reading = reader.read([path.name], "motor.toml")
    assert "Columns of duty" in reading.checks
    assert "ASSUMED" in reading.checks
