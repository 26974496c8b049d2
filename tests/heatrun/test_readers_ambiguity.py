"""Headers, signs and spellings: what says two things is asked about, the rest is read."""

import numpy as np
import pytest

from heatrun.errors import InputError
from heatrun.motor.file import load_motor
from heatrun.readers.channel_map import map_columns
from heatrun.readers.mapping import unit_of
from heatrun.readers.read import read_record
from heatrun.readers.text.reader import read_text
from heatrun.readers.text.remarks import units_of_remarks
from heatrun.record.channels import CHANNEL
from heatrun.record.header import split_name
from heatrun.record.motor import Motor
from heatrun.record.table import Column, Table

VALUES = np.array([1.0, 2.0])


def mapped(name, channel, *, beside=(), spec=None):
    """Map one column to a channel by `[columns]`, under its label unless told otherwise."""
    label, unit = split_name(name)
    column = Column(name, label, unit, VALUES, beside=tuple(beside))
    table = Table((column,), {}, {}, (), (), "test")
    return map_columns(table, {channel: spec or label}, where="test.csv")


@pytest.mark.parametrize(
    ("name", "channel", "said"),
    [
        ("losses_MW_mean [kW]", "losses_W", ("MW", "kW")),
        ("losses | MW [W]", "losses_W", ("MW", "W")),
        ("losses/MW [W]", "losses_W", ("MW", "W")),
        ("losses MW [kilowatt]", "losses_W", ("MW", "kilowatt")),
        ("time_ms [s]", "time_s", ("ms", "s")),
        ("time:ms [h]", "time_s", ("ms", "h")),
        ("time_min [s]", "time_s", ("min", "s")),
        ("phase_current-Arms [mA]", "phase_current_A", ("Arms", "mA")),
        ("I_Apk [A]", "phase_current_A", ("Apk", "A")),
        ("iq_Arms [A]", "i_q_A", ("Arms", "A")),
        ("T_Grad [K]", "winding_degC", ("Grad", "K")),
        ("U_volt [kV]", "dc_voltage_V", ("volt", "kV")),
    ],
)
def test_two_units_in_one_header_are_asked_about(name, channel, said):
    label, unit = split_name(name)
    with pytest.raises(InputError) as asked:
        unit_of(Column(name, label, unit, VALUES), CHANNEL[channel], "test.csv")
    assert f"The name says {said[0]}, the unit behind it {said[1]}." in str(asked.value)


@pytest.mark.parametrize(
    ("name", "channel", "factor"),
    [
        ("I_rms [A]", "phase_current_A", 1.0),
        ("I_Arms [A]", "phase_current_A", 1.0),
        ("I_mA [mA_peak]", "phase_current_A", 1e-3 / np.sqrt(2.0)),
        ("I_amps [A_peak]", "phase_current_A", 1.0 / np.sqrt(2.0)),
        ("i_q_amps [A_rms]", "i_q_A", np.sqrt(2.0)),
        ("P_MW [MW]", "losses_W", 1e6),
        ("losses at 10 kW [W]", "losses_W", 1.0),
        ("T_deg [C]", "winding_degC", 1.0),
        ("n U/min [rpm]", "speed_rpm", 1.0),
        ("T_max [degC]", "winding_degC", 1.0),
    ],
)
def test_what_agrees_or_says_more_is_read(name, channel, factor):
    found = mapped(name, channel)
    np.testing.assert_allclose(found.channels[channel], factor * VALUES)


def test_a_bare_name_takes_the_unit_that_is_left_in_the_header():
    found = mapped("T_wdg K", "winding_degC", spec="T_wdg")
    np.testing.assert_allclose(found.channels["winding_degC"], VALUES - 273.15)
    assert [reading.unit for reading in found.readings] == ["K"]


@pytest.mark.parametrize("other", ["T_wdg B", "T_wdg_2"])
def test_a_bare_name_that_begins_two_headers_is_none(other):
    pair = [Column(name, name, None, VALUES) for name in ("T_wdg F", other)]
    table = Table(tuple(pair), {}, {}, (), (), "test")
    with pytest.raises(InputError, match="which the file does not have"):
        map_columns(table, {"winding_degC": "T_wdg"}, where="test.csv")


def test_columns_decides_against_a_unit_in_the_name_and_says_so():
    found = mapped("losses_MW [kW]", "losses_W", spec="losses_MW [kW] [W]")
    np.testing.assert_array_equal(found.channels["losses_W"], VALUES)
    assert "unit_overridden" in [finding.id for finding in found.findings]


@pytest.mark.parametrize(
    "name",
    ["I_hat [A]", "Ihat [A]", "î [A]", "i\N{COMBINING CIRCUMFLEX ACCENT}_U [A]", "I^ [A]",
     "I_ph_hat [A]", "Spitzenstrom [A]", "I-pk [A]", "I.amp [A]"],
)  # fmt: skip
def test_names_of_amplitudes_are_pointed_out(name):
    found = mapped(name, "phase_current_A")
    assert [finding.id for finding in found.findings] == ["current_maybe_amplitude"]


@pytest.mark.parametrize("name", ["I_ph [A]", "I_rms [A]", "I_hatch [A]"])
def test_other_names_of_currents_are_not(name):
    found = mapped(name, "phase_current_A", spec=f"{name.split(' [')[0]} [A]")
    assert "current_maybe_amplitude" not in [finding.id for finding in found.findings]


def test_a_kind_that_columns_states_ends_the_doubt():
    found = mapped("I_hat [A]", "phase_current_A", spec="I_hat [A] [A_rms]")
    assert "current_maybe_amplitude" not in [finding.id for finding in found.findings]
    found = mapped("i_d_rms [A]", "i_d_A", spec="i_d_rms [A] [A_peak]")
    assert "current_maybe_rms" not in [finding.id for finding in found.findings]


def test_rms_in_the_name_of_a_d_current_is_pointed_out():
    found = mapped("i_d_rms [A]", "i_d_A")
    (finding,) = found.findings
    assert finding.id == "current_maybe_rms"
    assert "i_d_rms [A_rms]" in finding.remedy
    assert not mapped("i_d_rms [A_rms]", "i_d_A").findings


@pytest.mark.parametrize(
    "line",
    ["# I_ph: peak value", "# I_ph is the peak value", "% I_ph = amplitude", "I_ph in peak values",
     "# currents are amplitudes", "# Strom: Scheitelwert", "# all currents given as peak"],
)  # fmt: skip
def test_a_line_that_calls_the_current_an_amplitude_is_passed_on(line):
    ((said,), beside_losses) = units_of_remarks([line], ["I_ph", "P_loss"])
    assert said.scope == "kind"
    assert len(beside_losses) <= 1
    found = mapped("I_ph [A]", "phase_current_A", beside=(said,))
    (finding,) = found.findings
    assert finding.id == "current_maybe_amplitude"
    assert "amplitude" in finding.message


@pytest.mark.parametrize("line", ["# peak load: 30 kW", "# P_loss: peak value", "# I_ph: rms"])
def test_other_lines_about_peaks_are_none_of_the_current(line):
    assert units_of_remarks([line], ["I_ph", "P_loss"])[0] == ()


def test_a_factor_in_a_name_is_asked_about_until_the_unit_is_decided(tmp_path):
    path = tmp_path / "test.csv"
    path.write_text("time_s;P_loss x0.1 [W]\n0;10\n1;20\n2;30\n")
    for text in ("P_loss x0.1 [W]", "P_loss x0.1"):
        with pytest.raises(InputError, match=r"factor 'x0\.1'"):
            read_record(path, Motor("M", columns={"losses_W": text}))
    motor = Motor("M", columns={"losses_W": "P_loss x0.1 [W] [W]"})
    assert read_record(path, motor)["losses_W"].tolist() == [10.0, 20.0, 30.0]


STATED_ABOVE = {
    "LabVIEW": "Y_Unit_Label\tkW\tK\ntime_s\tlosses\twinding\n0\t1\t300\n1\t2\t301\n2\t2\t302\n",
    "a list of channels": "Channel;Unit;Device\nlosses;kW;WT1806\nwinding;K;GL840\n\n"
    "time_s;losses;winding\n0;1;300\n1;2;301\n2;2;302\n",
    "one row": ";kW;K\ntime_s;losses;winding\n0;1;300\n1;2;301\n2;2;302\n",
}


@pytest.mark.parametrize("case", STATED_ABOVE)
def test_units_that_are_stated_above_the_names(tmp_path, case):
    path = tmp_path / "test.csv"
    path.write_text(STATED_ABOVE[case])
    record = read_record(path)
    assert record["losses_W"].tolist() == [1000.0, 2000.0, 2000.0]
    assert record["winding_degC"][0] == pytest.approx(26.85)


GROUPS_OF_THREE = ["0;4.500;20", "1;12.750;20", "2;-3.125;21", "3;950;21"]


def saved(tmp_path, rows, header="time_s;losses_W;winding_degC"):
    path = tmp_path / "test.csv"
    path.write_text("\n".join([header, *rows, ""]))
    return path


@pytest.mark.parametrize("sign", [".", ","])
def test_whole_numbers_with_groups_of_three_are_a_question(tmp_path, sign):
    path = saved(tmp_path, [row.replace(".", sign) for row in GROUPS_OF_THREE])
    with pytest.raises(InputError) as caught:
        read_record(path)
    assert f"'4{sign}500' may be 4.5 or 4500" in caught.value.problem
    assert f"decimal = '{sign}' for 4.5" in caught.value.remedy
    motor = tmp_path / "motor.toml"
    for decimal in (".", ","):  # both answers are possible
        motor.write_text(f"[motor]\nname = 'M'\ndecimal = '{decimal}'\n")
        truth = [4.5, 12.75, -3.125] if decimal == sign else [4500.0, 12750.0, -3125.0]
        record = read_record(path, load_motor(motor))
        assert record["losses_W"].tolist() == [*truth, 950.0]
        assert record["winding_degC"].tolist() == [20.0, 20.0, 21.0, 21.0]


ANSWERED = {
    "both signs in groups of three": (
        ["0;4.500;20,125", "1;5.500;21,125", "2;6.500;22,125"], r"may be",
        {"losses_W": [4500.0, 5500.0, 6500.0], "winding_degC": [20.125, 21.125, 22.125]}),
    "groups beside a settled sign": (
        ["0,5;1.234;20", "1,5;999,5;20", "2,5;1.240;21"],
        r"'1\.234' is a number only if.*decimal = ','", {"losses_W": [1234.0, 999.5, 1240.0]}),
    "a comma in quotes between commas": (
        ['"0","4,500",20', '"1","5,500",20'], r"'4,500' may be 4\.5 or 4500",
        {"losses_W": [4.5, 5.5]}),
}  # fmt: skip


@pytest.mark.parametrize("case", ANSWERED)
def test_what_the_decimal_sign_of_the_motor_file_answers(tmp_path, case):
    rows, question, values = ANSWERED[case]
    header = "time_s,losses_W,winding_degC" if '"' in rows[0] else "time_s;losses_W;winding_degC"
    path = saved(tmp_path, rows, header)
    with pytest.raises(InputError, match=question):
        read_record(path)
    record = read_record(path, Motor("M", decimal=","))
    for channel, expected in values.items():
        assert record[channel].tolist() == expected
    if '"' in rows[0]:
        points = read_record(path, Motor("M", decimal="."))
        assert points["losses_W"].tolist() == [4500.0, 5500.0]


@pytest.mark.parametrize(
    "cell", ["1.25", "0.500", "0.125", "1234.500", "4.5001", ".500", "4.500e0", "7."]
)
def test_one_number_that_settles_it_is_followed(tmp_path, cell):
    path = saved(tmp_path, [*GROUPS_OF_THREE * 3000, f"12000;7;{cell}"])
    record = read_record(path)
    assert record["losses_W"][:4].tolist() == [4.5, 12.75, -3.125, 950.0]
    assert record["winding_degC"][-1] == float(cell)


def test_dates_and_clocks_and_preambles_settle_nothing(tmp_path):
    rows = [f"20.11.2025 10:00:0{i}.5;4.500;20" for i in range(5)]
    path = saved(tmp_path, rows, "Version 1.25\nTime;losses_W;winding_degC")
    with pytest.raises(InputError, match=r"'4\.500' may be 4\.5 or 4500"):
        read_record(path)


def test_a_column_that_is_not_used_is_not_asked_about(tmp_path):
    path = saved(tmp_path, GROUPS_OF_THREE, "time_s;counter;winding_degC")
    assert read_record(path)["winding_degC"].tolist() == [20.0, 20.0, 21.0, 21.0]


def test_between_commas_a_point_is_decimal_with_a_doubt():
    table = read_text(b"time_s,P\n0,4.500\n1,4.750\n", "test.csv")
    assert table.columns[1].values.tolist() == [4.5, 4.75]
    (finding,) = table.findings
    assert finding.id == "decimal_assumed"
    assert finding.severity == "warning"


UNASKED = {
    "whole numbers alone": (
        ["0;4500;20", "1;12750;20", "2;999;21"], None, [4500.0, 12750.0, 999.0]),
    "groups beside decimals by the stated sign": (
        ["0;1.234,5;20,25", "1;1.234.567;20,5", "2;12;21,75"], ",", [1234.5, 1234567.0, 12.0]),
    "the minus of typesetters": (
        ["0;\u22125.5;20", "1;\u22126;20", "2;7;20.25"], None, [-5.5, -6.0, 7.0]),
    **{f"thousands that {sign!r} alone can separate": (
        [f"0,5;-1{sign}234,5;20", f"1,5;1{sign}234{sign}567;20", "2,5;12;21"], None,
        [-1234.5, 1234567.0, 12.0]) for sign in " \u00a0\u202f'’_"},
}  # fmt: skip


@pytest.mark.parametrize("case", UNASKED)
def test_numbers_that_leave_nothing_open_are_read(tmp_path, case):
    rows, decimal, losses = UNASKED[case]
    record = read_record(saved(tmp_path, rows), Motor("M", decimal=decimal))
    assert record["losses_W"].tolist() == losses
    assert record.findings == ()


def test_the_wrong_stated_sign_misreads_nothing_in_silence(tmp_path):
    path = saved(tmp_path, ["0;1,25;20", "1;1,5;20", "2;1,75;21"])
    record = read_record(path, Motor("M", decimal="."))
    assert "losses_W" not in record
    assert record.unused == ("losses_W",)


@pytest.mark.parametrize("value", ["';'", "1", "''", "true"])
def test_other_decimal_signs_are_refused(tmp_path, value):
    path = tmp_path / "motor.toml"
    path.write_text(f"[motor]\nname = 'M'\ndecimal = {value}\n")
    with pytest.raises(InputError, match=r"Expected one of \., , for decimal"):
        load_motor(path)


@pytest.mark.parametrize("line", ["time_s;losses_kW;winding_degC", "s;kW;°C"])
def test_a_second_header_among_the_data_is_refused(tmp_path, line):
    path = saved(tmp_path, ["0;1.25;20", "1;1.5;20", line, "2;1.75;21", "3;1.5;21"])
    with pytest.raises(InputError, match=r"Line 4 holds text in every column.*Split the file"):
        read_record(path)


def test_another_comment_among_the_data_is_told(tmp_path):
    rows = [f"{i};1.25;20" for i in range(40)]
    rows.insert(20, "# second shift")
    path = saved(tmp_path, rows, "time_s;losses;winding_degC")
    assert "'# second shift'" in read_record(path).findings[0].message


@pytest.mark.parametrize("delimiter", [",", ";"])
def test_a_temperature_settles_the_decimal_sign(tmp_path, delimiter):
    path = tmp_path / "test.csv"
    rows = ["time_s,losses_W,winding [degC]", "1.000,4.500,22.165", "2.000,5.250,22.181"]
    path.write_text("\n".join(rows).replace(",", delimiter) + "\n")
    record = read_record(path)
    assert record["losses_W"].tolist() == [4.5, 5.25]
    assert record.findings == ()
    assert any("decimal sign" in note for note in record.notes)


ROWS = "{0};1;20.5\n{1};2;20.6\n{2};3;20.7\n"


def times(cells, header="Time"):
    """Return the time of a small table [s]."""
    text = f"{header};P [W];T_w [degC]\n" + ROWS.format(*cells)
    return map_columns(read_text(text.encode(), "test.csv"), {}, where="test.csv").channels[
        "time_s"
    ]


@pytest.mark.parametrize(
    "cells",
    [
        ("0 days 23:59:50", "1 days 00:00:00", "1 days 00:00:10"),
        ("23:59:50", "1 day, 0:00:00", "1 day, 0:00:10"),
        ("0 days 00:00:00.000000", "0 days 00:00:10.000000", "0 days 00:00:20.000000"),
        ("20240131T235950", "20240201T000000", "20240201T000010"),
        ("20240131T235950Z", "20240201T000000Z", "20240201T000010Z"),
        ("20240131_235950.5", "20240201_000000.5", "20240201_000010.5"),
        ("31-Jan-2024 23:59:50", "01-Feb-2024 00:00:00", "01-Feb-2024 00:00:10"),
        ("28. Februar 2025 23:59:50", "1. März 2025 00:00:00", "1. März 2025 00:00:10"),
        ("Dec 31, 2024 11:59:50 PM", "Jan 1, 2025 12:00:00 AM", "Jan 1, 2025 12:00:10 AM"),
        ("30 avr. 2024 23:59:50", "1 mai 2024 00:00:00", "1 mai 2024 00:00:10"),
        ("31/mag/2024 23:59:50", "01/giu/2024 00:00:00", "01/giu/2024 00:00:10"),
    ],
)
def test_times_that_leave_one_reading_are_read(cells):
    np.testing.assert_array_equal(times(cells) - times(cells)[0], [0.0, 10.0, 20.0])


def test_a_word_that_is_no_month_is_no_date():
    with pytest.raises(KeyError):
        times(["31-Foo-2024 23:59:50"] * 3)


def test_days_that_do_not_exist_are_missing():
    found = times(("20240230T000000", "20240301T000000", "20240301T000010"))
    assert np.isnan(found[0])
    assert found[2] - found[1] == 10.0


@pytest.mark.parametrize("header", ["Time [d]", "time [d]", "Elapsed time [d]"])
def test_days_in_brackets(header):
    np.testing.assert_allclose(times(("0.5", "0.6", "0.7"), header), np.array([5, 6, 7]) * 8640.0)


def test_days_in_a_row_of_units():
    text = "Time;P;T_w\nd;W;degC\n" + ROWS.format("0.5", "0.6", "0.7")
    found = map_columns(read_text(text.encode(), "test.csv"), {}, where="test.csv")
    np.testing.assert_allclose(found.channels["time_s"], np.array([5, 6, 7]) * 8640.0)


@pytest.mark.parametrize("header", ["time_d", "Zeit d", "elapsed time-d"])
def test_a_d_without_brackets_is_a_question(header):
    table = read_text(f"{header};P\n0.5;1\n0.6;2\n".encode(), "test.csv")
    with pytest.raises(InputError, match="d may be days"):
        map_columns(table, {"time_s": header}, where="test.csv")


@pytest.mark.parametrize(
    ("header", "channel", "factor"),
    [
        ("Verlust [kWatt]", "losses_W", 1e3),
        ("Verlust [mWatt]", "losses_W", 1e-3),
        ("Drehzahl [kRPM]", "speed_rpm", 1e3),
        ("n [1000 U/min]", "speed_rpm", 1e3),
        ("I_U [uA]", "phase_current_A", 1e-6),
        ("I_U [µA]", "phase_current_A", 1e-6),
        ("I_U [\N{GREEK SMALL LETTER MU}A rms]", "phase_current_A", 1e-6),
    ],
)
def test_spellings_that_benches_use(header, channel, factor):
    table = read_text(f"t;{header}\n0;1\n1;2\n".encode(), "test.csv")
    found = map_columns(table, {channel: header}, where="test.csv")
    np.testing.assert_allclose(found.channels[channel], [factor, 2 * factor])


def test_microamperes_or_the_phase_u():
    table = read_text(b"t;I_uA\n0;1\n1;2\n", "test.csv")
    with pytest.raises(InputError, match="phase u"):
        map_columns(table, {"phase_current_A": "I_uA"}, where="test.csv")


NAMES = "time;phase_current;losses;winding"
UNITS = "s;A;kW;K"
DEVICES = "DAQ;WT1800;WT1800;TC2"
DATA = "0;10;0.5;300\n1;10;0.5;301\n2;10;0.5;302\n"


@pytest.mark.parametrize(
    "head",
    [
        (NAMES, UNITS, DEVICES),
        (NAMES, DEVICES, UNITS),
        (UNITS, NAMES, DEVICES),
        ("Bench 3;;;", NAMES, UNITS, DEVICES),
        (NAMES, "stamp;rms;sum;slot", DEVICES, UNITS),
    ],
)
def test_rows_of_devices_below_the_names(head):
    table = read_text(("\n".join(head) + "\n" + DATA).encode(), "test.csv")
    found = map_columns(table, {}, where="test.csv").channels
    np.testing.assert_allclose(found["losses_W"], 500.0)
    np.testing.assert_allclose(found["winding_degC"][0], 26.85)
    assert table.num_rows == 3


@pytest.mark.parametrize("below", ["moment;rms;sum in kW;slot", "DAQ;mA;WT;TC2"])
def test_a_row_that_speaks_of_units_is_not_passed_over(below):
    table = read_text(f"{NAMES}\n{below}\n{DATA}".encode(), "test.csv")
    assert "losses_W" not in map_columns(table, {}, where="test.csv").channels


@pytest.mark.parametrize("line", ["; losses in kW", "# losses: kW", "losses in kW", "// now in kW"])
def test_a_line_among_the_data_that_speaks_of_units_is_refused(line):
    text = f"{NAMES}\n{DATA}{line}\n" + DATA.replace("\n", " \n") * 10
    with pytest.raises(InputError, match="Line 5 among the data mentions units"):
        read_text(text.encode(), "test.csv")
