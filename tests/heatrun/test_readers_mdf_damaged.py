"""MDF 4 files that are of another version, unsorted, cut or hostile."""

from __future__ import annotations

import struct
import sys

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mdf_files import SLOW, drive_and_temperatures, signal, written

from heatrun.errors import InputError
from heatrun.readers.read import read_record


@pytest.fixture
def path(tmp_path):
    return tmp_path / "run.mf4"


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The bytes of a file with two rates, plain and compressed."""
    folder = tmp_path_factory.mktemp("mdf")
    plain = drive_and_temperatures(folder / "plain.mf4").read_bytes()
    packed = drive_and_temperatures(folder / "packed.mf4", compression=2).read_bytes()
    columns = drive_and_temperatures(folder / "columns.mf4", version="4.20").read_bytes()
    return {"plain": plain, "packed": packed, "columns": columns}


def test_other_versions_and_open_recordings_are_refused(path, whole):
    path.write_bytes(b"MDF     3.30    " + whole["plain"][16:])
    with pytest.raises(InputError, match=r"Expected MDF 4, got version 3.30.*convert"):
        read_record(path)
    path.write_bytes(b"UnFinMF " + whole["plain"][8:])
    with pytest.raises(InputError, match="did not close the file"):
        read_record(path)
    path.write_bytes(whole["plain"][:60] + b"\x01\0\0\0" + whole["plain"][64:])
    with pytest.raises(InputError, match="did not close the file"):
        read_record(path)


def test_without_asammdf_the_remedy_is_named(path, whole, monkeypatch):
    path.write_bytes(whole["plain"])
    monkeypatch.setitem(sys.modules, "asammdf", None)
    with pytest.raises(InputError, match=r"heatrun\[mdf\]"):
        read_record(path)


def blocks(data, kind):
    """Addresses of the blocks of one kind; they lie at multiples of 8."""
    return [at for at in range(64, len(data), 8) if data[at : at + 4] == kind]


def links_of(data, at):
    (count,) = struct.unpack_from("<Q", data, at + 16)
    return at + 24 + 8 * np.arange(count)


def patched(data, at, layout, *values):
    changed = bytearray(data)
    struct.pack_into(layout, changed, int(at), *values)
    return bytes(changed)


def hostile(data, packed):
    """Files that would hang, crash or fill the memory of a reader that trusts them."""
    group, channel = blocks(data, b"##CG")[0], blocks(data, b"##CN")[1]
    about_group, about_channel = links_of(data, group)[-1] + 8, links_of(data, channel)[-1] + 8
    zipped = blocks(packed, b"##DZ")[0] + 24
    first_data = blocks(data, b"##DG")[0]
    yield "two links lead to", patched(data, first_data + 24, "<Q", first_data)
    yield "two links lead to", patched(data, channel + 24, "<Q", channel)
    yield "where none may be", patched(data, channel + 24, "<Q", group)
    yield "samples of", patched(data, about_group + 8, "<Q", 10**15)
    yield "a channel at bytes", patched(data, about_channel + 4, "<I", 2**31)
    times = links_of(data, blocks(data, b"##CN")[0])[-1] + 8
    assert data[times] == 2  # the channel of times
    yield "a channel at bytes", patched(data, times + 4, "<I", 60_000)
    yield "a number of", patched(patched(data, about_channel + 8, "<I", 96),
                                 about_group + 24, "<I", 2**20)  # fmt: skip
    yield "ends beyond", patched(data, channel + 8, "<Q", 2**60)
    yield "links", patched(data, channel + 16, "<Q", 2**40)
    yield "compressed bytes that promise", patched(packed, zipped + 8, "<Q", 2**40)
    yield "states", patched(packed, zipped + 8, "<Q", 60_000)


def unsorted(data):
    """Two groups in one block of data, each record behind the number of its group."""
    changed = bytearray(data)
    (first, _), groups = blocks(data, b"##DG"), blocks(data, b"##CG")
    records = b"".join(
        struct.pack("<Bdd", number, time, number * time) for time in SLOW for number in (1, 2)
    )
    struct.pack_into("<Q", changed, first + 24, 0)  # no next group of data
    struct.pack_into("<Q", changed, first + 40, len(data))
    changed[first + 56] = 1  # length of the number [bytes]
    struct.pack_into("<Q", changed, groups[0] + 24, groups[1])
    for number, at in enumerate(groups, start=1):
        struct.pack_into("<Q", changed, links_of(data, at)[-1] + 8, number)
    return bytes(changed) + struct.pack("<4s4xQQ", b"##DT", 24 + len(records), 0) + records


def test_unsorted_records_are_sorted(path):
    groups = ("A", [signal("winding_degC", SLOW)]), ("B", [signal("losses_W", SLOW)])
    data = written(path, *groups).read_bytes()
    path.write_bytes(unsorted(data + bytes(-len(data) % 8)))
    record = read_record(path)
    assert np.array_equal(record["winding_degC"], SLOW)
    assert np.array_equal(record["losses_W"], 2.0 * SLOW)


def test_a_hostile_file_is_refused_before_it_is_followed(path, whole):
    for problem, data in hostile(whole["plain"], whole["packed"]):
        path.write_bytes(data)
        with pytest.raises(InputError, match=problem):
            read_record(path)


def test_a_cut_file_is_refused(path, whole, capfd):
    for data in whole.values():
        for length in range(8, len(data), 211):
            path.write_bytes(data[:length])
            with pytest.raises(InputError):
                read_record(path)
    assert capfd.readouterr() == ("", "")


@settings(
    deadline=20_000,  # a file of 25 kB that takes seconds is followed in circles
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(
    kind=st.sampled_from(["plain", "packed", "columns"]),
    places=st.lists(
        st.tuples(st.floats(0.0, 1.0, exclude_max=True), st.integers(0, 255)), min_size=1
    ),
    is_early=st.booleans(),
)
def test_flipped_bytes_give_a_record_or_our_error(path, whole, kind, places, is_early):
    data = bytearray(whole[kind])
    for share, value in places:  # the blocks that say what is where lie in front and behind
        data[int(share * (2000 if is_early else len(data)))] = value
    path.write_bytes(bytes(data))
    try:
        record = read_record(path)
    except InputError:  # any other exception is a fault
        return
    assert {values.shape for values in record.channels.values()} == {record.time_s.shape}
