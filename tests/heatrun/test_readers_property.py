"""Whatever a table is written like, the same numbers come back; broken files raise our error."""

from __future__ import annotations

import gzip
from contextlib import suppress

import numpy as np
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from heatrun.errors import InputError
from heatrun.readers.read import read_record
from heatrun.readers.text.reader import read_text

NAMES = ("T_winding", "Stator Body", "torque", "P")
UNITS = ("°C", "degC", "Nm", "kW")


@st.composite
def numbers(draw):
    width = draw(st.integers(2, 4))
    value = st.floats(-1e6, 1e6).map(lambda x: round(x, 4))
    row = st.lists(value, min_size=width, max_size=width)
    return draw(st.lists(row, min_size=3, max_size=12))


@st.composite
def styles(draw):
    delimiter = draw(st.sampled_from([",", ";", "\t", "|", " "]))
    decimal = draw(st.sampled_from([".", ","]))
    return {
        "delimiter": delimiter,
        "decimal": decimal,
        # Without quotes, a comma cannot separate cells and decimals at once.
        "quoted": (delimiter == "," and decimal == ",") or draw(st.booleans()),
        "codec": draw(st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "cp1252"])),
        "end": draw(st.sampled_from(["\n", "\r\n"])),
        "unit": draw(st.sampled_from(["none", "[]", "()", " / ", "row"])),
        "preamble": draw(st.integers(0, 3)),
        "trailing": delimiter != " " and draw(st.booleans()),
    }


def written(values, style):
    """Return a table in a style as bytes."""
    width = len(values[0])
    names = [name.replace(" ", "_") for name in NAMES[:width]]
    units = UNITS[:width]
    pattern = {"[]": "{0}[{1}]", "()": "{0}({1})", " / ": "{0}/{1}"}.get(style["unit"], "{0}")
    rows = [[pattern.format(name, unit) for name, unit in zip(names, units, strict=True)]]
    if style["unit"] == "row":
        rows.append(list(units))
    rows += [[repr(value).replace(".", style["decimal"]) for value in row] for row in values]
    if style["quoted"]:
        rows = [[f'"{cell}"' for cell in row] for row in rows]
    tail = style["delimiter"] if style["trailing"] else ""
    lines = [style["delimiter"].join(row) + tail for row in rows]
    lead = ['"Device: USB-2408"', '"Sample Count: 191"', "Operator: nobody"][: style["preamble"]]
    return style["end"].join([*lead, *lines, ""]).encode(style["codec"])


@given(numbers(), styles())
def test_the_numbers_come_back_exactly(values, style):
    table = read_text(written(values, style), "test.csv")
    found = np.column_stack([column.values for column in table.columns])
    assert np.array_equal(found, np.array(values))
    assert [column.label for column in table.columns] == [
        name.replace(" ", "_") for name in NAMES[: len(values[0])]
    ]
    if style["unit"] != "none":
        assert [column.unit for column in table.columns] == list(UNITS[: len(values[0])])
    assert table.findings == ()


@given(numbers(), styles(), st.data())
def test_a_cut_file_gives_a_record_or_our_error(values, style, data):
    whole = written(values, style)
    cut = whole[: data.draw(st.integers(0, len(whole)))]
    try:
        table = read_text(cut, "test.csv")
    except InputError:
        return
    assert 1 <= table.num_rows <= len(values) + 1


@given(st.one_of(st.binary(max_size=200), st.text(max_size=200).map(str.encode)))
@example(b'"')
@example(b"a,b\n1e999,2\n")
@example("a,b\n１,２\n".encode())
@example(b"d,b\n00/00/2020 00:00,1\n99/99/2020 24:00,1\n")
def test_random_bytes_raise_our_error_alone(data):
    with suppress(InputError):  # any other exception is a fault
        read_text(data, "test.csv")


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.sampled_from([b"MATLAB 5.0 MAT-file", b"\x89HDF\r\n\x1a\n", b"PAR1", b"\x1f\x8b", b"t,T\n"]),
    st.binary(max_size=400),
    st.sampled_from(["csv", "mat", "parquet", "gz"]),
)
def test_random_bytes_behind_a_known_start_raise_our_error_alone(tmp_path, start, data, suffix):
    path = tmp_path / f"run.{suffix}"
    path.write_bytes(start + data)
    with suppress(InputError):  # any other exception is a fault
        read_record(path)


def test_a_cut_gzip_never_gives_a_shorter_record(tmp_path):
    packed = gzip.compress(b"time_s,winding_degC\n" + b"0,1\n" * 500)
    path = tmp_path / "run.csv.gz"
    outcomes = set()
    for length in range(2, len(packed)):
        path.write_bytes(packed[:length])
        try:
            outcomes.add(read_record(path).name)
        except InputError:
            outcomes.add("refused")
    assert outcomes == {"refused"}
