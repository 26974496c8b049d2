"""MATLAB files of both kinds."""

from __future__ import annotations

import h5py
import numpy as np
import pytest
import scipy.io

from heatrun.bench.read import read_raw, read_record
from heatrun.errors import InputError
from heatrun.motor import Motor

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
        "info (struct",
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
    with pytest.raises(InputError, match="MAT file"):
        read_raw(path)
