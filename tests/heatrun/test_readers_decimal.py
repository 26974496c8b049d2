"""Signs that may be decimal or separate thousands: what the file cannot settle is asked."""

from __future__ import annotations

import pytest

from heatrun.errors import InputError
from heatrun.motor.file import load_motor
from heatrun.readers.read import read_record
from heatrun.readers.text.reader import read_text
from heatrun.record.motor import Motor

ROWS = ["0;4.500;20", "1;12.750;20", "2;-3.125;21", "3;950;21"]


def written(tmp_path, rows, header="time_s;losses_W;winding_degC"):
    path = tmp_path / "test.csv"
    path.write_text("\n".join([header, *rows, ""]))
    return path


@pytest.mark.parametrize("sign", [".", ","])
def test_whole_numbers_with_groups_of_three_are_a_question(tmp_path, sign):
    path = written(tmp_path, [row.replace(".", sign) for row in ROWS])
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


def test_both_signs_in_groups_of_three_are_a_question(tmp_path):
    path = written(tmp_path, ["0;4.500;20,125", "1;5.500;21,125", "2;6.500;22,125"])
    with pytest.raises(InputError, match=r"may be"):
        read_record(path)
    record = read_record(path, Motor("M", decimal=","))
    assert record["losses_W"].tolist() == [4500.0, 5500.0, 6500.0]
    assert record["winding_degC"].tolist() == [20.125, 21.125, 22.125]


@pytest.mark.parametrize(
    "cell", ["1.25", "0.500", "0.125", "1234.500", "4.5001", ".500", "4.500e0", "7."]
)
def test_one_number_that_settles_it_is_followed(tmp_path, cell):
    path = written(tmp_path, [*ROWS * 3000, f"12000;7;{cell}"])
    record = read_record(path)
    assert record["losses_W"][:4].tolist() == [4.5, 12.75, -3.125, 950.0]
    assert record["winding_degC"][-1] == float(cell)


def test_dates_and_clocks_and_preambles_settle_nothing(tmp_path):
    rows = [f"20.11.2025 10:00:0{i}.5;4.500;20" for i in range(5)]
    path = written(tmp_path, rows, "Version 1.25\nTime;losses_W;winding_degC")
    with pytest.raises(InputError, match=r"'4\.500' may be 4\.5 or 4500"):
        read_record(path)


def test_a_column_that_is_not_used_is_not_asked_about(tmp_path):
    path = written(tmp_path, ROWS, "time_s;counter;winding_degC")
    assert read_record(path)["winding_degC"].tolist() == [20.0, 20.0, 21.0, 21.0]


def test_whole_numbers_alone_are_no_question(tmp_path):
    path = written(tmp_path, ["0;4500;20", "1;12750;20", "2;999;21"])
    assert read_record(path)["losses_W"].tolist() == [4500.0, 12750.0, 999.0]


def test_between_commas_a_point_is_decimal_with_a_doubt():
    table = read_text(b"time_s,P\n0,4.500\n1,4.750\n", "test.csv")
    assert table.columns[1].values.tolist() == [4.5, 4.75]
    (finding,) = table.findings
    assert finding.id == "decimal_assumed"
    assert finding.severity == "warning"


def test_a_comma_in_quotes_between_commas_is_a_question(tmp_path):
    path = tmp_path / "test.csv"
    path.write_text('time_s,losses_W\n"0","4,500"\n"1","5,500"\n')
    with pytest.raises(InputError, match=r"'4,500' may be 4\.5 or 4500"):
        read_record(path)
    assert read_record(path, Motor("M", decimal=","))["losses_W"].tolist() == [4.5, 5.5]
    assert read_record(path, Motor("M", decimal="."))["losses_W"].tolist() == [4500.0, 5500.0]


def test_a_stated_sign_reads_groups_beside_decimals(tmp_path):
    path = written(tmp_path, ["0;1.234,5;20,25", "1;1.234.567;20,5", "2;12;21,75"])
    record = read_record(path, Motor("M", decimal=","))
    assert record["losses_W"].tolist() == [1234.5, 1234567.0, 12.0]
    assert record.findings == ()


def test_the_wrong_stated_sign_misreads_nothing_in_silence(tmp_path):
    path = written(tmp_path, ["0;1,25;20", "1;1,5;20", "2;1,75;21"])
    record = read_record(path, Motor("M", decimal="."))
    assert "losses_W" not in record
    assert record.unused == ("losses_W",)


@pytest.mark.parametrize("value", ["';'", "1", "''", "true"])
def test_other_decimal_signs_are_refused(tmp_path, value):
    path = tmp_path / "motor.toml"
    path.write_text(f"[motor]\nname = 'M'\ndecimal = {value}\n")
    with pytest.raises(InputError, match=r"Expected one of \., , for decimal"):
        load_motor(path)


@pytest.mark.parametrize("sign", [" ", "\u00a0", "\u202f", "'", "’", "_"])
def test_signs_that_can_only_separate_thousands_are_read(tmp_path, sign):
    path = written(tmp_path, [f"0,5;-1{sign}234,5;20", f"1,5;1{sign}234{sign}567;20", "2,5;12;21"])
    assert read_record(path)["losses_W"].tolist() == [-1234.5, 1234567.0, 12.0]


def test_groups_beside_a_settled_sign_are_a_question_with_a_remedy(tmp_path):
    path = written(tmp_path, ["0,5;1.234;20", "1,5;999,5;20", "2,5;1.240;21"])
    with pytest.raises(InputError, match=r"'1\.234' is a number only if.*decimal = ','"):
        read_record(path)
    record = read_record(path, Motor("M", decimal=","))
    assert record["losses_W"].tolist() == [1234.0, 999.5, 1240.0]


def test_the_minus_of_typesetters(tmp_path):
    path = written(tmp_path, ["0;1.25;\u22125.5", "1;1.5;\u22126", "2;1.75;7"])
    assert read_record(path)["winding_degC"].tolist() == [-5.5, -6.0, 7.0]


@pytest.mark.parametrize("line", ["time_s;losses_kW;winding_degC", "s;kW;°C"])
def test_a_second_header_among_the_data_is_refused(tmp_path, line):
    path = written(tmp_path, ["0;1.25;20", "1;1.5;20", line, "2;1.75;21", "3;1.5;21"])
    with pytest.raises(InputError, match=r"Line 4 holds text in every column.*Split the file"):
        read_record(path)


def test_a_comment_among_the_data_that_speaks_of_units_is_refused(tmp_path):
    rows = [f"{i};1.25;20" for i in range(40)]
    rows.insert(20, "# losses in kW")
    path = written(tmp_path, rows, "time_s;losses;winding_degC")
    with pytest.raises(InputError, match=r"Line 22 among the data mentions units"):
        read_record(path)
    rows[20] = "# second shift"
    path = written(tmp_path, rows, "time_s;losses;winding_degC")
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
