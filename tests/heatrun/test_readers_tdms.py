"""TDMS files: times, scalings, damaged files."""

import struct
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from heatrun.errors import InputError
from heatrun.readers.read import read_record
from heatrun.record.motor import Motor

nptdms = pytest.importorskip("nptdms")
FAST = np.arange(200) * 0.1
SLOW = np.arange(20) * 1.0
START = np.datetime64("2025-11-20T18:02:33.000000")
LINEAR = {
    "NI_Number_Of_Scales": 1,
    "NI_Scale[0]_Scale_Type": "Linear",
    "NI_Scale[0]_Linear_Slope": 2.0,
    "NI_Scale[0]_Linear_Y_Intercept": 20.0,
    "NI_Scale[0]_Linear_Input_Source": 0xFFFFFFFF,
}


def channel(group, name, values, unit="", **properties):
    held = {"unit_string": unit} if unit else {}
    return nptdms.ChannelObject(group, name, np.asarray(values), properties=held | properties)


def wave(group, name, values, unit="", step_s=1.0, **properties):
    return channel(
        group, name, values, unit, wf_increment=step_s, wf_start_offset=0.0, **properties
    )


def written(path, *segments):
    with nptdms.TdmsWriter(path) as writer:
        for segment in segments:
            writer.write_segment(segment)
    return path


def two_rates(start_s=0.0):
    return [
        wave("Drive", "phase_current_A", 100.0 + FAST, "A", 0.1),
        channel("Rig", "time", SLOW + start_s, "s"),
        channel("Rig", "winding_degC", SLOW, "degC", **LINEAR),
        nptdms.ChannelObject("Rig", "note", ["a"] * SLOW.size),
    ]


@pytest.fixture
def path(tmp_path):
    return tmp_path / "run.tdms"


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The bytes of a file of two segments."""
    path = tmp_path_factory.mktemp("tdms") / "whole.tdms"
    return written(path, two_rates(), two_rates(20.0)).read_bytes()


def test_rates_and_scalings(path):
    record = read_record(written(path, two_rates()))
    assert np.array_equal(record.time_s, SLOW)
    np.testing.assert_allclose(record["winding_degC"], 20.0 + 2.0 * SLOW, atol=1e-12)
    # A ramp of 1 A/s: over 1 s its root mean square lies 1/(24·100) A above its middle.
    np.testing.assert_allclose(record["phase_current_A"][1:-1], 100.0 + SLOW[1:-1], atol=1e-3)
    assert record.unused == ("note",)


def test_starts_of_waveforms_count(path):
    later = START + np.timedelta64(2_500_000, "us")
    written(
        path,
        [
            wave("A", "winding_degC", SLOW, wf_start_time=START),
            wave("B", "losses_W", 7.0 * SLOW, wf_start_time=later),
        ],
    )
    record = read_record(path)
    assert any("2025-11-20T18:02:33.000000 UTC" in note for note in record.notes)
    assert np.isnan(record["losses_W"]).tolist() == [True] * 3 + [False] * 17
    np.testing.assert_allclose(record["losses_W"][4:], 7.0 * (SLOW[4:] - 2.5), atol=1e-9)


def test_a_channel_of_dates_is_the_time(path):
    dates = START + (FAST * 1e6).round().astype("timedelta64[us]")
    written(path, [channel("A", "timestamp", dates), channel("A", "winding_degC", FAST)])
    record = read_record(path)
    # microseconds as float64 seconds: exact to one rounding
    np.testing.assert_allclose(record.time_s, FAST, atol=1e-12)
    assert any("2025-11-20T18:02:33" in note for note in record.notes)


def test_the_motor_file_may_name_the_time(path):
    written(path, [channel("A", "tick", 1e3 * FAST, "ms"), channel("A", "winding_degC", FAST)])
    with pytest.raises(InputError, match="no time column; its columns are: tick, winding_degC"):
        read_record(path)
    motor = Motor("M", columns={"time_s": "tick"})
    np.testing.assert_allclose(read_record(path, motor).time_s, FAST, atol=1e-12)
    by_rate = read_record(path, Motor("M", columns={"time_s": "rate 10 Hz"}))
    np.testing.assert_allclose(by_rate.time_s, FAST, atol=1e-12)
    np.testing.assert_allclose(read_record(path, rate_Hz=10.0).time_s, FAST, atol=1e-12)


@pytest.mark.parametrize(
    ("name", "unit", "text", "factor", "unit_from"),
    [
        ("clock", "ms", "clock", 1e-3, "stated"),
        ("clock", "s", "clock [ms]", 1e-3, "stated"),
        ("clock_ms", "", "clock_ms", 1e-3, "name"),
        ("[min] clock", "", "clock", 60.0, "stated"),
        ("clock", "", "clock", 1.0, "assumed"),
    ],
)
def test_units_of_channels_of_times(path, name, unit, text, factor, unit_from):
    written(path, [channel("A", name, FAST, unit), channel("A", "winding_degC", FAST)])
    record = read_record(path, Motor("M", columns={"time_s": text}))
    np.testing.assert_allclose(record.time_s, factor * FAST, rtol=1e-12)
    assert record.mapping[0].unit_from == unit_from


def test_times_of_two_units_are_asked_for(path):
    written(path, [channel("A", "t [s]", FAST, "ms"), channel("A", "winding_degC", FAST)])
    with pytest.raises(InputError, match="The name says s, the unit beside it ms"):
        read_record(path)


def test_lengths_without_times_and_groups_of_one_name(path):
    written(path, [channel("A", "winding_degC", FAST), channel("B", "losses_W", SLOW)])
    with pytest.raises(InputError, match=r"must be of one length.* 200, 'losses_W' 20"):
        read_record(path, rate_Hz=1.0)
    written(path, [wave("A", "winding_degC", SLOW), wave("B", "winding_degC", SLOW + 1.0)])
    with pytest.raises(InputError, match="'A/winding_degC' and 'B/winding_degC' both stand for"):
        read_record(path)
    motor = Motor("M", columns={"winding_degC": "B/winding_degC"})
    assert np.array_equal(read_record(path, motor)["winding_degC"], SLOW + 1.0)


def test_text_and_wrong_units_are_refused(path):
    written(path, two_rates())
    with pytest.raises(InputError, match="'note' for winding_degC holds the text"):
        read_record(path, Motor("M", columns={"winding_degC": "note"}))
    written(path, [wave("A", "winding_degC", SLOW, "V")])
    with pytest.raises(InputError, match="Expected a unit of temperature, got V"):
        read_record(path)


@pytest.mark.parametrize(
    ("changed", "problem"),
    [
        ({"NI_Scale[0]_Scale_Type": "Formula"}, "scaling Formula is not read"),
        ({"NI_Number_Of_Scales": 2_000_000_000}, "states 2000000000 scalings"),
        ({"NI_Number_Of_Scales": 6}
         | {f"NI_Scale[{number}]_Scale_Type": "Add" for number in range(1, 6)}, "Add, Subtract"),
    ],
)  # fmt: skip
def test_a_scaling_that_is_not_known_is_refused(path, changed, problem):
    written(path, [wave("A", "winding_degC", SLOW, **(LINEAR | changed))])
    with pytest.raises(InputError, match=problem):
        read_record(path)


def test_an_index_beside_the_file_is_not_opened(path, whole):
    path.write_bytes(whole)
    before = read_record(path)
    Path(f"{path}_index").write_bytes(b"TDSh" + b"\xff" * 400)
    assert np.array_equal(read_record(path)["winding_degC"], before["winding_degC"])
    with pytest.raises(InputError, match="Give the TDMS file itself"):
        read_record(f"{path}_index")


def test_an_unclosed_recording_is_read_with_a_warning(path, whole):
    (length,) = struct.unpack_from("<Q", whole, 12)
    last = 28 + length
    unclosed = bytearray(whole)
    struct.pack_into("<Q", unclosed, last + 12, 2**64 - 1)
    path.write_bytes(unclosed)
    record = read_record(path)
    assert "recording_not_closed" in {finding.id for finding in record.findings}
    assert record["winding_degC"].size == 2 * SLOW.size


def test_a_cut_file_is_refused(path, whole, capfd):
    (length,) = struct.unpack_from("<Q", whole, 12)
    for cut in range(4, len(whole), 41):
        if cut == 28 + length:  # a whole segment is a whole file
            continue
        path.write_bytes(whole[:cut])
        with pytest.raises(InputError):
            read_record(path)
    assert capfd.readouterr() == ("", "")


def test_absurd_sizes_are_refused(path, whole):
    for at in (12, 20):  # length of the segment, of its metadata
        data = bytearray(whole)
        struct.pack_into("<Q", data, at, 2**62)
        path.write_bytes(bytes(data))
        with pytest.raises(InputError, match="ends beyond"):
            read_record(path)
    data = bytearray(whole)
    name = data.index(b"phase_current_A'") + len(b"phase_current_A'")
    struct.pack_into("<Q", data, name + 4 + 8, 2**50)  # number of values
    path.write_bytes(bytes(data))
    tracemalloc.start()
    with pytest.raises(InputError, match="state another length"):
        read_record(path)
    assert tracemalloc.get_traced_memory()[1] < 50e6
    tracemalloc.stop()
