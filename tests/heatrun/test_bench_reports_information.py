"""The General Information table by hand; whatever a record holds ends in a report or an error."""

import json
import math
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from heatrun.errors import InputError
from heatrun.io.texts import Texts
from heatrun.record.channels import CHANNELS
from heatrun.record.motor import Motor
from heatrun.record.record import Record
from heatrun.reports.printed import told
from heatrun.results import to_json
from heatrun_reports import TEST_TYPES, Reference, build_report, make_report
from heatrun_reports.analysis.drive import above_one, operating_map
from heatrun_reports.analysis.general_information import general_information
from heatrun_reports.document import csv_table, document_content, report_content
from heatrun_reports.general import shaft_energy

CAR = Motor("car", gear_ratio=9.1, wheel_radius_m=0.3)


def made(name: str, time_s, **channels) -> Record:
    """A record; a number is a channel that does not change."""
    time_s = np.asarray(time_s, dtype=float)
    columns = {key: np.broadcast_to(np.asarray(v, dtype=float), time_s.shape).copy()
               for key, v in channels.items()}  # fmt: skip
    return Record(name, {"time_s": time_s, **columns})


# Four samples, 10 s, 10 s and 20 s apart, at 100 V: P = 0, 1000, -500, 500 W; v = 0, 10, 10, 0 m/s.
SMALL = made("Test_2022_12_07_001", [0, 10, 20, 40], dc_voltage_V=100, dc_current_A=[0, 10, -5, 5],
             vehicle_speed_km_per_h=[0, 36, 36, 0])  # fmt: skip


def without(record: Record, *channels: str) -> Record:
    return replace(record, channels={k: v for k, v in record.channels.items() if k not in channels})


def changed(record: Record, **channels: list[float]) -> Record:
    new = {name: np.array(values, dtype=float) for name, values in channels.items()}
    return replace(record, channels={**record.channels, **new})


def test_the_table_of_a_small_record_by_hand():
    # net:   0..10 s 5000 J, 10..20 s 2500 J, 20..40 s 0 J                          = 7500 J
    # drawn: 5000 J; 1000 W down to 0 at two thirds of 10 s, 1000/2 * 20/3 = 10000/3 J;
    #        0 up to 500 W in the second half of 20 s, 500/2 * 10 = 2500 J           = 32500/3 J
    # path:  50 + 100 + 100 m                                                        = 250 m
    found = general_information(SMALL, CAR)
    expected = {
        "energy_kWh": 7500 / 3.6e6,
        "energy_without_regeneration_kWh": 32500 / 3 / 3.6e6,
        "distance_km": 0.25,
        "consumption_Wh_per_km": 7500 / 3600 / 0.25,
        "consumption_without_regeneration_Wh_per_km": 32500 / 3 / 3600 / 0.25,
        "reduction_percent": 100 * (1 - 7500 / (32500 / 3)),
    }
    for name, value in expected.items():
        assert getattr(found, name) == pytest.approx(value, rel=1e-12), name
    assert not found.findings
    assert expected["reduction_percent"] == pytest.approx(30.769, abs=1e-3)  # as printed


def test_a_gap_adds_nothing_and_is_said():
    record = made("gap", [0, 10, 20, 120, 130], dc_power_W=360, vehicle_speed_km_per_h=36)
    found = general_information(record, CAR)
    # 30 s are covered: 360 W and 10 m/s give 10800 J and 300 m
    assert found.energy_kWh == pytest.approx(0.003)
    assert found.distance_km == pytest.approx(0.3)
    (finding,) = found.findings
    assert finding.values["left_out_s"] == 100.0
    assert finding.id == "not_integrated"
    assert "100.0 s" in finding.message


def test_the_distance_follows_from_motor_speed_gear_and_wheel():
    record = made("motor speed", np.arange(61), dc_power_W=100, speed_rpm=-910)
    # 910 rpm over a gear of 9.1 turn the wheel 100 times in the minute, each 2 pi 0.3 m; backwards
    found = general_information(record, CAR)
    assert found.distance_km == pytest.approx(100 * 2 * math.pi * 0.3 / 1000)


@pytest.mark.parametrize("kind", ["energy", "general"])
def test_a_report_of_a_vehicle_without_speed_says_what_is_missing(kind):
    report = build_report(kind, CAR, without(SMALL, "vehicle_speed_km_per_h"))
    assert {f.id for f in report.findings} == {"no_speed"}
    rows = {row.name: row for row in report.rows}
    assert rows["energy_kWh"].value == pytest.approx(7500 / 3.6e6)
    assert rows["distance_km"].value is None
    assert "no speed" in rows["distance_km"].note


PUMP = Motor("pump")
RAD_PER_S = 100.0
# 100 s at 20, 60 and 100 Nm each, after 50 s without load, at 100 rad/s: 2, 6 and 10 kW
PARTS = [50, 100, 100, 100]
LOADED = made("pump", np.arange(350), speed_rpm=RAD_PER_S * 30 / math.pi,
              torque_Nm=np.repeat([0, 20, 60, 100], PARTS),
              electrical_power_W=np.repeat([500, 2500, 7500, 12500], PARTS))  # fmt: skip


def test_an_industrial_motor_needs_no_gear_for_energy_and_efficiency():
    report = build_report("energy", PUMP, LOADED)
    rows = {row.name: row for row in report.rows}
    assert not report.findings
    assert not any("distance" in name or "km" in name for name in rows)
    assert not any("distance" in word.casefold() for word, _ in report.definitions)
    # trapezoids over 349 s: half a second of each end is missing, and steps are slopes of a second
    assert rows["energy_kWh"].value == pytest.approx(2_275_000 / 3.6e6, rel=5e-3)
    assert rows["shaft_out_kWh"].value == pytest.approx(1_800_000 / 3.6e6, rel=5e-3)
    assert "shaft_in_kWh" not in rows
    assert rows["mean_power_kW"].value == pytest.approx(6.5, rel=5e-3)
    assert rows["largest_power_kW"].value == 12.5
    assert str(rows["largest_fed_back_kW"].value) == "0.0"
    idle = build_report("energy", PUMP, changed(LOADED, electrical_power_W=LOADED["torque_Nm"]))
    assert [str(r.value) for r in idle.rows if r.name == "largest_fed_back_kW"] == ["0.0"]
    assert rows["efficiency_motor_percent"].value == pytest.approx(80.0, rel=1e-3)
    assert "efficiency 80 % as a motor" in report.summary
    assert rows["efficiency_generator_percent"].note == "undefined: never ran as a generator"
    for say in (Texts("de"), Texts("it")):
        assert all(say.again(row.note) != row.note for row in rows.values() if row.note)
    general = build_report("general", PUMP, LOADED)
    assert {row.name for row in general.rows} == {
        "energy_kWh", "energy_without_regeneration_kWh"
    }  # fmt: skip
    assert not general.findings


def test_energy_is_told_by_how_hard_a_motor_worked():
    report = build_report("energy", PUMP, LOADED)
    assert "By load, in % of 10 kW at the shaft" in report.tables[0].title
    lines = {line.name: line.cells for line in report.tables[0].lines}
    assert list(lines) == ["no load", "2 … 25 %", "50 … 75 %", "75 … 100 %"]
    minutes, drawn, peak, shaft, losses, efficiency = lines["50 … 75 %"]
    assert minutes == pytest.approx(100 / 60)
    assert (drawn, peak, losses) == (7.5, 7.5, pytest.approx(1.5))
    assert shaft == pytest.approx(6.0)
    assert efficiency == pytest.approx(80.0)
    assert lines["no load"][-1] is None
    assert lines["no load"][1] == 0.5
    assert "By load" not in build_report("energy", CAR, LOADED).tables[0].title


def test_a_motor_that_is_driven_is_a_generator_in_a_range_of_its_own():
    torque, power = LOADED["torque_Nm"].copy(), LOADED["electrical_power_W"].copy()
    torque[250:], power[250:] = -100.0, -9000.0
    driven = changed(LOADED, torque_Nm=torque, electrical_power_W=power)
    report = build_report("energy", PUMP, driven)
    rows = {row.name: row.value for row in report.rows}
    assert rows["efficiency_generator_percent"] == pytest.approx(90.0, rel=1e-3)
    assert rows["shaft_in_kWh"] == pytest.approx(1_000_000 / 3.6e6, rel=1e-2)
    lines = {line.name: line.cells for line in report.tables[0].lines}
    assert next(iter(lines)) == "as a generator"
    assert lines["as a generator"][-1] == pytest.approx(90.0)


def test_energy_without_torque_has_no_efficiency_and_is_no_error():
    report = build_report("energy", PUMP, without(LOADED, "torque_Nm"))
    names = {row.name for row in report.rows}
    assert "energy_kWh" in names
    assert not any("efficiency" in name or "shaft" in name for name in names)


def test_a_vehicle_without_a_wheel_radius_says_where_to_write_it():
    record = changed(without(SMALL, "vehicle_speed_km_per_h"), speed_rpm=[0, 900, 900, 0])
    report = build_report("energy", Motor("half a car", gear_ratio=9.1), record)
    (finding,) = report.findings
    assert "needs wheel_radius_m" in finding.message
    assert "[vehicle]" in finding.remedy


@pytest.mark.parametrize(
    ("channels", "figure", "id"),
    [
        ({"vehicle_speed_km_per_h": [0, 0, 0, 0]}, "consumption_Wh_per_km", "distance_zero"),
        ({"dc_current_A": [-1, -10, -5, -5]}, "reduction_percent", "power_negative"),
    ],
    ids=["without distance", "power is negative throughout"],
)
def test_what_is_undefined_is_none_and_a_finding(channels, figure, id):
    found = general_information(changed(SMALL, **channels), CAR)
    assert getattr(found, figure) is None
    assert [f.id for f in found.findings] == [id]
    if id == "distance_zero":
        assert found.distance_km == 0.0
        assert "below 1 m" in found.undefined[figure]
    else:
        assert found.energy_without_regeneration_kWh == 0.0


@pytest.mark.parametrize(
    ("kind", "record", "said"),
    [
        ("energy", without(SMALL, "dc_current_A"), "dc_voltage_V and dc_current_A"),
        ("general", changed(SMALL, time_s=[0, 10, 5, 40]), "falls from"),
        ("general", Record("empty", {"time_s": np.arange(5.0)}), "at least one signal"),
    ],
    ids=["no power", "time runs backwards", "no signal"],
)
def test_a_record_that_allows_no_report_is_refused_with_the_reason(kind, record, said):
    with pytest.raises(InputError, match=said):
        build_report(kind, CAR, record)


def test_efficiency_is_energy_over_energy_in_each_direction():
    # Half of the time as a motor at 80 %, half as a generator at 50 %; shaft power is 2 pi T n/60.
    speed = np.full(200, 3000.0)
    torque = np.repeat([10.0, -10.0], 100)
    shaft = torque * speed * 2 * math.pi / 60
    # a map needs some spread of the speed
    record = made("map", np.arange(200), speed_rpm=speed + np.tile([-1.0, 1.0], 100),
                  torque_Nm=torque,
                  electrical_power_W=np.where(torque > 0, shaft / 0.8, shaft * 0.5))  # fmt: skip
    found = operating_map(record, CAR)
    assert found is not None
    # the speed alternates by 1/3000 around the one that the power was made with
    whole = shaft_energy(record, CAR)
    assert whole is not None
    assert whole.efficiency_motor == pytest.approx(0.8, rel=1e-3)
    assert whole.efficiency_generator == pytest.approx(0.5, rel=1e-3)
    assert np.nanmax(found.efficiency) == pytest.approx(0.8, rel=1e-3)


def test_an_efficiency_above_one_is_a_finding():
    record = made("wrong unit", np.arange(50), speed_rpm=np.linspace(1000.0, 3000.0, 50),
                  torque_Nm=np.linspace(5.0, 10.0, 50), electrical_power_W=1,
                  vehicle_speed_km_per_h=30)  # fmt: skip
    report = build_report("energy", CAR, record)
    assert "efficiency_above_one" in {f.id for f in report.findings}


def test_a_torque_at_standstill_is_told_beside_the_efficiency_in_any_language():
    """A transducer that reads 1.2 N m at rest: 95.9 % in the report and not a word."""
    time_s = np.arange(0.0, 1800.0, 2.0)
    runs = (time_s > 600.0) & (time_s < 1200.0)
    speed, torque = 1500.0 * runs, 18.0 * runs + 1.2
    shaft = torque * speed * np.pi / 30.0
    record = made("offset", time_s, speed_rpm=speed, torque_Nm=torque, mechanical_power_W=shaft,
                  phase_current_A=20.0 * runs, electrical_power_W=shaft + 100.0 * runs,
                  losses_W=100.0 * runs, ambient_degC=21.0, winding_degC=22.0)  # fmt: skip
    motor = Motor("m", phase_resistance_ohm=0.05)
    report = build_report("energy", motor, record)
    (seen,) = [f for f in report.findings if f.id == "shaft_power_disagrees"]
    assert "no torque at standstill without current; it reads 1.2 N m" in seen.message
    assert "no temperature" not in seen.message  # nothing is corrected here
    above = above_one(record, np.array([0.9, 1.05]))
    for each in (seen, *above):
        for language in ("de", "it"):
            said, is_known = told(each, Texts(language))
            assert is_known, said


def test_a_temperature_has_its_rise_beside_it():
    record = made("warm", np.arange(100.0), winding_degC=80.0, ambient_degC=20.0, torque_Nm=1.0)
    report = build_report("general", Motor("m", phase_resistance_ohm=0.05), record)
    lines = {line.name: line for line in report.tables[0].lines}
    assert "winding over ambient" in lines
    assert sum("over ambient" in name for name in lines) == 1


PRINTED = {
    "energy_kWh": "0.0039",
    "energy_without_regeneration_kWh": "0.0039",
    "distance_km": "0.0159",
    "consumption_Wh_per_km": "247.1165",
    "consumption_without_regeneration_Wh_per_km": "247.1165",
    "reduction_percent": "0.0000",
}
"""General Information of Test_2022_12_07_001, as the thesis prints it (its Figure 6)."""


def test_the_six_printed_figures_of_the_thesis_from_a_record_that_has_them():
    # 1 m/s held for 15.9 s is a way of 15.9 m = 0.0159 km. 247.1165 Wh/km are 247.1165 * 3.6 J/m,
    # so at 1 m/s 889.6194 W: 14144.95 J = 0.003929 kWh. Nothing is fed back.
    record = made("Test_2022_12_07_001", np.arange(160) / 10.0, dc_voltage_V=48.0,
                  dc_current_A=247.1165 * 3.6 / 48.0, vehicle_speed_km_per_h=3.6)  # fmt: skip
    report = build_report("general", CAR, record)
    rows = {row.name: row for row in report.rows}
    assert list(rows) == list(PRINTED)  # all six, in the order of the figure
    for name, text in PRINTED.items():
        assert f"{rows[name].value:.4f}" == text
    assert [row.unit for row in rows.values()] == ["kWh", "kWh", "km", "Wh/km", "Wh/km", "%"]
    # printed to four places, energy over distance gives 0.0039/0.0159 = 245 Wh/km: the last figure
    # is of more digits than the thesis prints
    assert pytest.approx(245.28, abs=0.01) == 1000 * 0.0039 / 0.0159


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
