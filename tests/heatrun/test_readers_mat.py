"""MATLAB files of both kinds."""

from __future__ import annotations

import struct

import h5py
import numpy as np
import pytest
import scipy.io

from heatrun.errors import InputError
from heatrun.readers.read import read_raw, read_record
from heatrun.record.motor import Motor

N = 40
SIGNALS = {
    "t": np.arange(N) * 0.1,
    "Is": np.full(N, 100.0),
    "Pd": np.linspace(0.0, 900.0, N),
    "Te": np.full(N, 22.0),
    "Tw_m": np.linspace(22.0, 40.0, N),
}
CONSTANTS = {"B": 234.5, "Rrif": 0.0186, "Trif": 25.0, "Ceqw": 666.75, "Two": 22.0}


def prova(path, **more):
    columns = {name: value[:, None] for name, value in SIGNALS.items()}
    scipy.io.savemat(path, columns | CONSTANTS | more)
    return path


def test_signals_and_constants_of_the_thesis_file(tmp_path):
    record = read_record(prova(tmp_path / "prova.mat"))
    assert record.name == "prova"
    assert np.array_equal(record["winding_degC"], SIGNALS["Tw_m"])
    assert np.array_equal(record["losses_W"], SIGNALS["Pd"])
    assert record.unused == ()
    assert any("Rrif = 0.0186, 3 times the phase resistance" in note for note in record.notes)
    assert read_raw(tmp_path / "prova.mat").constants == CONSTANTS


def test_a_scalar_ambient_is_a_channel(tmp_path):
    path = prova(tmp_path / "prova.mat", Te=21.5)
    record = read_record(path)
    assert np.array_equal(record["ambient_degC"], np.full(N, 21.5))
    assert any("ambient_degC" in note and "constant" in note for note in record.notes)


def test_what_is_no_vector_is_left_out_with_a_finding(tmp_path):
    path = prova(
        tmp_path / "prova.mat",
        run=np.arange(7.0),
        matrix=np.ones((4, 4)),
        info={"bench": "A"},
        text="hello",
        wave=np.ones(N) * 1j,
    )
    table = read_raw(path)
    assert {column.name for column in table.columns} == set(SIGNALS)
    (finding,) = table.findings
    assert finding.values == {"count": 5, "length": N}
    for name in (
        "run (1x7 numbers)",
        "matrix (4x4",
        "info (struct with the fields bench)",
        "text (text)",
        "wave (complex)",
    ):
        assert name in finding.message


def test_version_73(tmp_path):
    path = tmp_path / "prova.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, value in SIGNALS.items():
            file.create_dataset(name, data=value[None, :]).attrs["MATLAB_class"] = np.bytes_(
                "double"
            )
        file.create_dataset("B", data=[[234.5]]).attrs["MATLAB_class"] = np.bytes_("double")
        file.create_dataset("note", data=[[104, 105]]).attrs["MATLAB_class"] = np.bytes_("char")
        file.create_group("timeseries").attrs["MATLAB_class"] = np.bytes_("struct")
        file.create_group("#refs#")
    content = bytearray(path.read_bytes())
    content[:19] = b"MATLAB 7.3 MAT-file"
    path.write_bytes(content)
    table = read_raw(path)
    assert table.constants == {"B": 234.5}
    assert {column.name for column in table.columns} == set(SIGNALS)
    assert table.findings[0].values["count"] == 2
    assert np.array_equal(read_record(path)["winding_degC"], SIGNALS["Tw_m"])


def test_times_in_single_precision_are_put_on_their_grid(tmp_path):
    path = prova(tmp_path / "prova.mat", t=SIGNALS["t"].astype(np.float32))
    assert np.array_equal(read_record(path).time_s, np.round(SIGNALS["t"], 1))


def test_resistance_of_file_and_motor(tmp_path):
    path = prova(tmp_path / "prova.mat")
    agreeing = read_record(path, Motor("M", phase_resistance_ohm=0.0062))
    assert agreeing.findings == ()
    # The same winding stated at 70 degC
    hot = 0.0062 * (234.5 + 70.0) / (234.5 + 25.0)
    motor = Motor("M", phase_resistance_ohm=hot, reference_temperature_degC=70.0)
    assert read_record(path, motor).findings == ()
    (finding,) = read_record(path, Motor("M", phase_resistance_ohm=0.0186)).findings
    assert finding.id == "resistance_conflict"
    assert finding.test == "prova"


def test_damaged_or_empty_files(tmp_path):
    path = prova(tmp_path / "prova.mat")
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match="could not be read"):
        read_raw(path)
    scipy.io.savemat(path, {"B": 1.0, "text": "hello"})
    with pytest.raises(InputError, match=r"numeric vectors.*holds B, text"):
        read_raw(path)
    path.write_text("no mat file at all")
    with pytest.raises(InputError, match="version 5, 7 or"):
        read_raw(path)


@pytest.mark.parametrize("compressed", [False, True])
@pytest.mark.parametrize(
    "dtype", ["f8", "f4", "i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "bool", ">f8"]
)
def test_every_number_type_reads_as_another_library_wrote_it(tmp_path, dtype, compressed):
    path = tmp_path / "types.mat"
    values = (np.arange(25) % 7).astype(dtype)
    scipy.io.savemat(path, {"a_long_name": values, "b": values[:, None]}, do_compression=compressed)
    for column in read_raw(path).columns:
        assert column.values.dtype == np.float64
        assert np.array_equal(column.values, values.astype(float))


def test_a_timeseries_is_left_out_by_name(tmp_path):
    path = prova(tmp_path / "prova.mat")
    # MATLAB keeps a timeseries as an opaque object: flags, then its name, its type, its class.
    parts = [struct.pack("<IIII", 6, 8, 17, 0)]
    parts += [struct.pack("<HH4s", 1, len(text), text) for text in (b"run", b"MCOS", b"ts")]
    content = b"".join(parts)
    path.write_bytes(path.read_bytes() + struct.pack("<II", 14, len(content)) + content)
    table = read_raw(path)
    assert {column.name for column in table.columns} == set(SIGNALS)
    assert "run (object such as a timeseries)" in table.findings[0].message


def big_endian(name: str, values: list[float]) -> bytes:
    """Return a MAT file as a big-endian workstation wrote it."""
    flags = struct.pack(">IIII", 6, 8, 6, 0)
    shape = struct.pack(">IIii", 5, 8, len(values), 1)
    label = struct.pack(">HH4s", len(name), 1, name.encode())
    numbers = struct.pack(f">II{len(values)}d", 9, 8 * len(values), *values)
    matrix = flags + shape + label + numbers
    head = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x01\x00MI"
    return head + struct.pack(">II", 14, len(matrix)) + matrix


def test_big_endian_files(tmp_path):
    path = tmp_path / "old.mat"
    path.write_bytes(big_endian("Tw", [20.0, 21.5, -3.25]))
    (column,) = read_raw(path).columns
    assert column.name == "Tw"
    assert column.values.tolist() == [20.0, 21.5, -3.25]


@pytest.mark.parametrize("compressed", [False, True])
def test_a_damaged_file_never_gives_other_numbers_of_samples(tmp_path, compressed):
    path = tmp_path / "prova.mat"
    scipy.io.savemat(path, SIGNALS | CONSTANTS, do_compression=compressed)
    whole = path.read_bytes()
    rng = np.random.default_rng(7)
    refused = 0
    for _ in range(300):
        broken = bytearray(whole)
        broken[rng.integers(len(whole))] = rng.integers(256)
        path.write_bytes(broken[: rng.integers(1, len(whole))] if rng.random() < 0.5 else broken)
        try:
            assert read_raw(path).num_rows == N
        except InputError:
            refused += 1
    assert refused > 150  # every cut one at the least, but for those that end between variables
