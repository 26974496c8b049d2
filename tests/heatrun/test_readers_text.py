"""Text tables as benches write them, one oddity a test."""

import gzip

import numpy as np
import pytest

from heatrun.errors import InputError
from heatrun.readers.channel_map import map_columns
from heatrun.readers.read import read_raw
from heatrun.readers.text.reader import read_text


def columns(text: str | bytes):
    data = text.encode() if isinstance(text, str) else text
    table = read_text(data, "test.csv")
    return {column.name: column for column in table.columns}, table


@pytest.mark.parametrize(
    ("decimal", "delimiter"),
    [(".", ","), *((sign, d) for sign in ".," for d in (";", "\t", "|", " ", "   "))],
)
def test_every_delimiter_and_decimal_sign(delimiter, decimal):
    rows = (["t", "T"], ["0.5", "20.25"], ["1", "-3.0e1"])
    text = "\n".join(delimiter.join(row) for row in rows).replace(".", decimal)
    found, table = columns(text)
    assert found["t"].values.tolist() == [0.5, 1.0]
    assert found["T"].values.tolist() == [20.25, -30.0]
    assert ("decimal comma" in table.reader) == (decimal == ",")


def unreadable(count, first_line):
    return "unreadable_cells", {"count": count, "first_line": first_line}


def ragged(count, first_line):
    return "ragged_rows", {"count": count, "first_line": first_line}


nan = float("nan")
TABLES = {
    "decimal comma in quotes": (
        '"t","T"\n"0,5","20,25"\n"1,0","20,5"\n', {"t": [0.5, 1], "T": [20.25, 20.5]}, {}),
    "decimal comma first below the sample": (
        "t;T\n" + "0;1\n" * 3000 + "1,5;2,5\n", {"t": [0] * 3000 + [1.5], "T": [1] * 3000 + [2.5]},
        {}),
    "carriage returns": ("t,T\r0,1\r1,2\r", {"t": [0, 1], "T": [1, 2]}, {}),
    "preamble padded by a spreadsheet": (
        "Device: X;;\nRun: 3;;\nt;P;T\n0;1;5\n1;2;6\n;;\n;;\n",
        {"t": [0, 1], "P": [1, 2], "T": [5, 6]}, {"notes": ["Device: X", "Run: 3"]}),
    "delimiters at the ends": ("t,T,\n1,2,\n3,4,\n", {"t": [1, 3], "T": [2, 4]}, {}),
    "delimiters behind the data": ("t,T\n1,2,\n3,4,\n", {"t": [1, 3], "T": [2, 4]}, {}),
    "a delimiter behind the names": ("t,T,\n1,2\n3,4\n", {"t": [1, 3], "T": [2, 4]}, {}),
    "a preamble in quotes": (
        '"Device: USB-2408"\n"Start Time: 20/11/2025 18:02:33.0"\n\n"t","T"\n"0","1"\n"1","2"\n',
        {"t": [0, 1], "T": [1, 2]},
        {"notes": ["Device: USB-2408", "Start Time: 20/11/2025 18:02:33.0"]}),
    "a preamble of pairs is no data": (
        "Rate;10\nName;X\nTime;Temp\n0;20\n1;21\n2;22\n",
        {"Time": [0, 1, 2], "Temp": [20, 21, 22]}, {"notes": ["Rate;10", "Name;X"]}),
    "numbers as names": (
        "Time;1;2;3\n0;20;21;22\n1;20;21;22\n",
        {"Time": [0, 1], "1": [20, 20], "2": [21, 21], "3": [22, 22]}, {}),
    "first samples without signal are no names": (
        "t;A;B\n0.0;no signal;no signal\n0.1;20.1;3.1\n0.2;20.1;3\n0.3;1.1;2\n",
        {"t": [0, 0.1, 0.2, 0.3], "A": [nan, 20.1, 20.1, 1.1], "B": [nan, 3.1, 3, 2]},
        {"findings": [unreadable(1, 2)] * 2, "message": "'no signal'"}),
    "unreadable cells are counted and shown": (
        "t,T\n0,0\n1,1\n2,over\n3,1\n4,over\n5,5\n",
        {"t": [0, 1, 2, 3, 4, 5], "T": [0, 1, nan, 1, nan, 5]},
        {"findings": [unreadable(2, 4)], "message": "'over'"}),
    "marks of missing values": (
        "t,T\n0,NaN\n1,nan\n2,#N/A\n3,\n4,5\n5,-\n",
        {"t": [0, 1, 2, 3, 4, 5], "T": [nan, nan, nan, nan, 5, nan]}, {}),
    "infinity": (
        "t,P\n0,inf\n1,2\n2,-inf\n", {"t": [0, 1, 2], "P": [nan, 2, nan]},
        {"findings": [unreadable(2, 2)]}),
    "a named column without values": (
        "a,b,Serial 36\n1,2,\n3,4,\n", {"a": [1, 3], "b": [2, 4]}, {"text": {"Serial 36": ""}}),
    "ragged lines are left out with their numbers": (
        "a,b,c\n" + "1,2,3\n" * 30 + "1,2\n" + "1,2,3\n1,2,3,4\n1,2",
        {"a": [1] * 31, "b": [2] * 31, "c": [3] * 31},
        {"findings": [ragged(3, 32)], "message": "32, 34, 35"}),
    "an open quote costs its own line alone": (
        't,P\n0,1\n1,"2\n2,3\n' + "3,4\n" * 20, {"t": [0, 2] + [3] * 20, "P": [1, 3] + [4] * 20},
        {"findings": [ragged(1, 3)]}),
    "quotes may hold the delimiter": (
        't,"Torque, shaft (Nm)",note\n0,5,"a, b"\n1,6,"c, d"\n',
        {"t": [0, 1], "Torque, shaft (Nm)": [5, 6]}, {"text": {"note": "a, b"}}),
    "text and switches": (
        "t,T,state,fan,on\n0,20,RUN,on,True\n1,21,STOP,off,False\n",
        {"t": [0, 1], "T": [20, 21], "fan": [1, 0], "on": [1, 0]}, {"text": {"state": "RUN"}}),
    "names behind # in a table of blanks": (
        "# time  T_w\n0.0 20.0\n0.1 20.5\n", {"time": [0, 0.1], "T_w": [20, 20.5]}, {}),
    "blanks in units in a table of blanks": (
        "  time [s]   T_w [degC]\n   0.0   20.0\n  0.1  20.5\n",
        {"time [s]": [0, 0.1], "T_w [degC]": [20, 20.5]}, {}),
}  # fmt: skip
"""Text, its columns, and what is told beside them: notes, findings, columns of text."""


@pytest.mark.parametrize("member", TABLES)
def test_odd_tables_are_read(member):
    text, expected, more = TABLES[member]
    found, table = columns(text)
    assert list(found) == list(expected)
    for name, values in expected.items():
        np.testing.assert_array_equal(found[name].values, values)
    assert table.text_columns == more.get("text", {})
    assert table.notes == tuple(f"Preamble: {line}" for line in more.get("notes", ()))
    assert [(one.id, one.values) for one in table.findings] == more.get("findings", [])
    assert all(more.get("message", "") in one.message for one in table.findings)


@pytest.mark.parametrize(
    "codec", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "utf-32", "cp1252"]
)
def test_encodings(codec):
    found, _ = columns("t [s],T [°C]\n0,20.5\n1,20.6\n".encode(codec))
    assert found["T [°C]"].unit == "°C"
    assert found["T [°C]"].values.tolist() == [20.5, 20.6]


def test_utf8_cut_inside_a_character_is_not_taken_for_another_encoding():
    found, table = columns("t,T (°C)\n0,20.5\n1,20.6\n2,3°".encode()[:-1])
    assert "T (°C)" in found
    assert "cut" in table.reader


def test_row_of_units_below_the_names():
    found, _ = columns("t;T_w;n\ns;°C;1/min\n0,0;20,5;100\n0,1;20,6;101\n")
    assert [column.unit for column in found.values()] == ["s", "°C", "1/min"]
    found, _ = columns("t,T_w\n[ms],[furlong]\n0,20.5\n1,20.6\n")
    assert [column.unit for column in found.values()] == ["ms", "furlong"]


DATA = "0,20,5\n1,21,5\n2,22,6\n"


def units(text: str) -> list[str]:
    """Return the units in which t, T and P of a table are read, and how each is known."""
    table = read_text(text.encode(), "test.csv")
    names = {"time_s": "t", "winding_degC": "T", "losses_W": "P"}
    found = map_columns(table, names, where="test.csv")
    marks = {"stated": "", "assumed": "?"}
    return [one.unit + marks[one.unit_from] for one in found.readings]


@pytest.mark.parametrize(
    "row",
    ["min,K,kW", "[min],[K],[kW]", "(min),(K),(kW)", "min,kelvin,kilowatts", "# min, K, kW",
     "min,K,in kW", "----,---,---\nmin,K,kW", "\nmin,K,kW", "Unit,min,K,kW", "Einheit:,min,K,kW"],
)  # fmt: skip
@pytest.mark.parametrize("pattern", ["t,T,P\n{}\n", "{}\nt,T,P\n"])
def test_row_of_units_below_or_above_the_names(pattern, row):
    assert units(pattern.format(row) + DATA) == ["min", "K", "kW"]


def test_row_of_units_under_a_column_of_their_own_name():
    for row in ("Unit,min,K,kW", "Einheit,min,K,kW", "-,min,K,kW"):
        for head in (f"No,t,T,P\n{row}\n", f"{row}\nNo,t,T,P\n"):
            assert units(f"{head}1,0,20,5\n2,1,21,5\n") == ["min", "K", "kW"]


def test_row_of_units_in_blanks():
    for head in ("t T P\nmin K kW\n", "# t T P\n# min K kW\n", "# min K kW\n# t T P\n"):
        assert units(f"{head}0 20 5\n1 21 5\n") == ["min", "K", "kW"]


def test_row_with_a_unit_that_is_not_known():
    with pytest.raises(InputError, match="The unit 'furlong' is not known for a power"):
        units("t,T,P\nmin,K,furlong\n" + DATA)


def test_row_of_units_and_names_must_agree():
    text = "t [s],T,P [W]\ns,K,kW\n" + DATA
    with pytest.raises(InputError, match="The name says W, the row of units kW"):
        units(text)
    with pytest.raises(InputError, match="The row of units says min, the line 't in s' s"):
        units("# t in s\nmin,K,kW\nt,T,P\n" + DATA)


COMMENTS = {
    "s? degC? kW": ("# P in kW", "% P: kW", "# P = kW", "P [kW]", "# P is given in kilowatts",
                    "# Unit of P: kW", "# column 3: kW", "# 3: P [kW]", "Leistungen in kW"),
    "s? K W?": ("# T: K",),  # not t
    "min degC? kW": ("# t in min, P in kW",),
    "min K kW": ("# t [min]; T [K]; P [kW]", "# units: min, K, kW", "# Units min K kW",
                 "Einheiten: min; K; kW"),
    "s? degF W?": ("# all temperatures in °F",),
    "ms degC? W?": ("Time unit: ms",),
    "s? degC? W?": ("Rated power [kW],50", "Motor: X, power: 5 kW", "Sensor: U12 in rack B",
                    "# rated speed in rpm"),
}  # fmt: skip
"""By the units of t, T and P that a line gives; those with a question mark are assumed."""


@pytest.mark.parametrize(("expected", "line"), [(k, one) for k, v in COMMENTS.items() for one in v])
def test_units_in_comment_lines(line, expected):
    assert units(f"{line}\nt,T,P\n{DATA}") == expected.split()
    if line[0] in "#%":
        assert units(f"t,T,P\n{line}\n{DATA}") == expected.split()


@pytest.mark.parametrize("line", ["# units: kW", "# rated power in kW", "# P in furlong", "# P: K"])
def test_comment_lines_that_are_not_understood_are_asked_for(line):
    with pytest.raises(InputError) as caught:
        units(f"{line}\nt,T,P\n{DATA}")
    unit = "W" if "kW" in line else "UNIT"
    assert f'losses_W = "P [{unit}]"' in caught.value.remedy


def test_a_comment_below_the_names_is_kept_and_is_no_row_of_names():
    found, table = columns("t,P\n# P in kW, t in min\n0,1\n1,2\n")
    assert list(found) == ["t", "P"]
    assert [column.unit for column in found.values()] == ["min", "kW"]
    assert table.notes == ("Preamble: # P in kW, t in min",)
    assert table.findings == ()


def test_a_cell_too_long_for_a_name_is_refused():
    with pytest.raises(InputError, match="at most 1000 characters") as caught:
        columns("t," + "(" * 100_000 + "\n0,1\n1,2\n")
    assert caught.value.where == "test.csv, column 2"


def test_separators_of_thousands_beside_the_decimal_sign_can_be_nothing_else():
    found, table = columns("t;P\n0,0;1.234,5\n0,1;1.234\n0,2;999,5\n")
    assert found["P"].values.tolist() == [1234.5, 1234.0, 999.5]
    assert table.findings == ()


def test_names_are_never_shifted_against_the_data():
    text = "time T1 T2\n2025-11-20 18:02:33 21 22\n2025-11-20 18:02:34 21 22\n"
    with pytest.raises(InputError, match="names 3 columns, the lines of data have 4"):
        columns(text)
    with pytest.raises(InputError, match="names 3 columns, the lines of data have 2"):
        columns("a,b,c\n1,2\n3,4\n")


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "empty file"),
        ("\n \n\n", "empty file"),
        ("time_s,T\n", "no line of numbers"),
        ("1,2\n3,4\n", "row of column names"),
        ("T\n1\n2\n", "one single column"),
        ("These are the notes of the experimenter,\nin two lines.\n", "no line of numbers"),
        ("\x00\x01\x02\x03" * 20, "no text"),
        ("a,b\nNaN,NaN\n", "no line of numbers"),
        ("a,b,c\n" + "1,2,3\n1,2\n" * 10, "Expected 3 cells"),
    ],
)
def test_what_is_no_table_is_refused(text, problem):
    with pytest.raises(InputError, match=problem) as caught:
        columns(text)
    assert caught.value.remedy
    assert caught.value.where == "test.csv"


def test_what_is_no_file_is_refused(tmp_path):
    with pytest.raises(InputError, match="directory"):
        read_raw(tmp_path)
    with pytest.raises(InputError, match="cannot be opened"):
        read_raw(tmp_path / "none.csv")
    (tmp_path / "empty.csv").write_bytes(b"")
    with pytest.raises(InputError, match="empty"):
        read_raw(tmp_path / "empty.csv")
    (tmp_path / "book.csv").write_bytes(b"PK\x03\x04" + b"\x00" * 50)
    with pytest.raises(InputError, match="Excel workbook, it could not be read"):
        read_raw(tmp_path / "book.csv")


def test_gzip_and_damaged_gzip(tmp_path):
    packed = gzip.compress(b"t,T\n0,1\n1,2\n" * 40)
    path = tmp_path / "run.csv.gz"
    path.write_bytes(gzip.compress(b"t,T\n0,1\n1,2\n"))
    assert read_raw(path).reader.endswith("gzip")
    path.write_bytes(packed[:-9])
    with pytest.raises(InputError, match="gzip"):
        read_raw(path)


def test_fifty_thousand_rows_are_read_without_a_loop_over_them(num_calls):
    rng = np.random.default_rng(3)
    values = rng.normal(50.0, 20.0, (50_000, 10)).round(4)
    lines = [";".join(map(repr, row)).replace(".", ",") for row in values.tolist()]
    head = ";".join(f"c{i} [degC]" for i in range(10))
    few, all_ = ("\n".join([head, *lines[:num]]).encode() for num in (5_000, 50_000))
    table = read_text(all_, "test.csv")
    num_few = num_calls(lambda: read_text(few, "test.csv"))
    assert 100 < num_calls(lambda: read_text(all_, "test.csv")) < 2 * num_few
    assert np.array_equal(np.column_stack([c.values for c in table.columns]), values)
