"""Times, dates, units and rows of headers that benches write and that leave nothing open."""

from __future__ import annotations

import numpy as np
import pytest

from heatrun.errors import InputError
from heatrun.readers.channel_map import map_columns
from heatrun.readers.text.reader import read_text

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


def test_one_unit_alone_in_a_row_above_the_names():
    table = read_text(f";;kW;\n{NAMES}\n{DATA}".encode(), "test.csv")
    losses = map_columns(table, {}, where="test.csv").channels["losses_W"]
    np.testing.assert_allclose(losses, 500.0)
