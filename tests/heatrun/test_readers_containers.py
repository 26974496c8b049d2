"""Files whose signals lie in structs, groups, cells and matrices, and files of raw bus frames."""

from __future__ import annotations

import h5py
import numpy as np
import pytest
import scipy.io

from heatrun.errors import InputError
from heatrun.init.survey import survey
from heatrun.readers.read import read_raw, read_record
from heatrun.record.motor import Motor
from heatrun.record.table import kind_of_frames

N = 30
T = 4.0 * np.arange(N)
COIL = 21.0 + 40.0 * (1.0 - np.exp(-T / 35.0))
ROOM = np.linspace(20.5, 21.0, N)
PHASE = np.where(np.arange(N) < N / 2, 9.0, 3.0)


def structs(*fields):
    """Return a MATLAB array of structs."""
    found = np.empty((1, len(fields)), dtype=[(name, object) for name in fields[0]])
    for k, one in enumerate(fields):
        for name, value in one.items():
            found[0, k][name] = value
    return found


def signal(values, label):
    return {"values": values, "label": label, "dimensions": 1.0}


def axis(data, name, unit):
    return {"Name": name, "Type": 8.0, "Data": data, "Unit": unit, "XIndex": 1.0}


def column(values):
    return values[:, None]


MAT = {
    "fields of a struct": (
        {"run": {"t": column(T), "coil": column(COIL), "phase": column(PHASE), "who": "R. Bosch"}},
        {"time_s": "run.t [s]", "winding_degC": "run.coil [degC]",
         "phase_current_A": "run.phase [A]"},
    ),
    "a struct within a struct": (
        {"m": {"meta": {"T_room": 21.0}, "daq": {"t": T, "T1": COIL, "I1": PHASE}}},
        {"time_s": "m.daq.t [s]", "winding_degC": "m.daq.T1 [degC]",
         "phase_current_A": "m.daq.I1 [A]"},
    ),
    "Simulink structure with time": (
        {"simout": {"time": column(T), "blockName": "bench/Scope", "signals": structs(
            signal(column(COIL), "T_w"), signal(column(PHASE), "I_ph"))}},
        {"time_s": "simout.time [s]", "winding_degC": "T_w [degC]",
         "phase_current_A": "simout.signals(2).values [A]"},
    ),
    "one Simulink signal of two columns": (
        {"scope": {"time": column(T), "signals": signal(np.column_stack([COIL, PHASE]), "")}},
        {"time_s": "scope.time [s]", "winding_degC": "scope.signals.values(:,1) [degC]",
         "phase_current_A": "scope.signals.values(:,2) [A]"},
    ),
    "dSPACE": (
        {"trial7": {"X": axis(T, "", "s"), "Y": structs(
            axis(COIL, "Model Root/T_coil", "degC"), axis(PHASE, "Model Root/I_u", "A"))}},
        {"winding_degC": "Model Root/T_coil", "phase_current_A": "Model Root/I_u"},
    ),
    "times and data of a timeseries": (
        {"coil": {"Time": T, "Data": COIL, "Units": "degC"}, "phase": {"Time": T, "Data": PHASE}},
        {"time_s": "coil.Time [s]", "winding_degC": "coil.Data",
         "phase_current_A": "phase.Data [A]"},
    ),
    "columns of a matrix": (
        {"t": T, "gains": np.ones(3), "temps": np.column_stack([ROOM, COIL]), "cur": PHASE},
        {"time_s": "t", "winding_degC": "temps(:,2) [degC]", "phase_current_A": "cur [A]"},
    ),
    "rows of a matrix alone": (
        {"data": np.vstack([T, COIL, PHASE])},
        {"time_s": "data(1,:) [s]", "winding_degC": "data(2,:) [degC]",
         "phase_current_A": "data(3,:) [A]"},
    ),
    "elements of a cell": (
        {"c": np.array([T, COIL, PHASE, "bench"], dtype=object)},
        {"time_s": "c(1) [s]", "winding_degC": "c(2) [degC]", "phase_current_A": "c(3) [A]"},
    ),
}  # fmt: skip


def holds_the_run(path, columns):
    record = read_record(path, Motor("M", columns=columns))
    np.testing.assert_array_equal(record.time_s, T)
    np.testing.assert_array_equal(record["winding_degC"], COIL)
    np.testing.assert_array_equal(record["phase_current_A"], PHASE)


@pytest.mark.parametrize("compressed", [False, True])
@pytest.mark.parametrize("member", MAT)
def test_what_matlab_nests(tmp_path, member, compressed):
    variables, columns = MAT[member]
    path = tmp_path / "run.mat"
    scipy.io.savemat(path, variables, do_compression=compressed, oned_as="column")
    holds_the_run(path, columns)


def test_names_in_structs_are_recognised(tmp_path):
    path = tmp_path / "run.mat"
    fields = {"time_s": T, "winding_degC": COIL, "ambient_degC": ROOM, "phase_current_A": PHASE}
    scipy.io.savemat(path, {"log": fields})
    found = {one.channel: one.column for one in survey(path).recognised}
    assert found == {name: f"log.{name}" for name in fields}


def test_columns_of_a_matrix_keep_the_unit_of_its_name(tmp_path):
    path = tmp_path / "run.mat"
    scipy.io.savemat(path, {"t": T, "coil_K": np.column_stack([COIL, ROOM]) + 273.15})
    record = read_record(path, Motor("M", columns={"winding_degC": "coil_K(:,1)"}))
    np.testing.assert_allclose(record["winding_degC"], COIL)


def test_many_short_settings_do_not_outvote_the_signals(tmp_path):
    path = tmp_path / "run.mat"
    settings = {f"k{i}": np.arange(3.0) for i in range(8)}
    scipy.io.savemat(path, {"t": T, "T_coil": COIL, "I": PHASE, "P": PHASE, "cfg": settings})
    assert read_raw(path).num_rows == N


def test_what_is_left_out_is_said_before_there_is_a_motor_file(tmp_path):
    path = tmp_path / "run.mat"
    scipy.io.savemat(path, {"t": T, "T_coil": COIL, "map": np.ones((7, 9)), "late": {"T": T[1:]}})
    (finding,) = survey(path).findings
    assert "map (7x9 numbers), late.T" in finding.message


def test_a_damaged_struct_is_an_error_and_no_other_number(tmp_path):
    path = tmp_path / "run.mat"
    scipy.io.savemat(path, MAT["Simulink structure with time"][0])
    whole = path.read_bytes()
    rng = np.random.default_rng(11)
    refused = 0
    for _ in range(200):
        broken = bytearray(whole)
        broken[rng.integers(128, len(whole))] = rng.integers(256)
        path.write_bytes(broken)
        try:
            assert read_raw(path).num_rows in (N, N - 1, 1, 2)
        except InputError:
            refused += 1
    assert 0 < refused < 200


def matlab(group, name, value):
    """Write a variable as MATLAB 7.3 does: its columns one behind the other, texts as numbers."""
    is_text = isinstance(value, str)
    data = np.array([[ord(c)] for c in value], dtype="u2") if is_text else np.atleast_2d(value)
    item = group.create_dataset(name, data=data if is_text or np.ndim(value) < 2 else data.T)
    item.attrs["MATLAB_class"] = np.bytes_("char" if is_text else "double")
    return item


def nested(file):
    group = file.create_group("log")
    group.attrs["MATLAB_class"] = np.bytes_("struct")
    for name, value in {"t": T, "coil": COIL, "phase": PHASE, "who": "R. Bosch"}.items():
        matlab(group, name, value)


def array_of_structs(file):
    """Write Y(k) as references into a group of MATLAB's own."""
    refs, trial = file.create_group("#refs#"), file.create_group("trial")
    trial.attrs["MATLAB_class"] = np.bytes_("struct")
    parts = {"X": [(T, "", "s")], "Y": [(COIL, "T_coil", "degC"), (PHASE, "I_u", "A")]}
    for part, signals in parts.items():
        group = trial.create_group(part)
        group.attrs["MATLAB_class"] = np.bytes_("struct")
        for k, key in enumerate(("Data", "Name", "Unit")):
            items = [
                matlab(refs, f"{part}{key}{i}", one[k] or "-")
                if k
                else matlab(refs, f"{part}{key}{i}", one[k])
                for i, one in enumerate(signals)
            ]
            group.create_dataset(key, data=np.array([[i.ref for i in items]], dtype=h5py.ref_dtype))


def matrix(file):
    matlab(file, "t", T)
    matlab(file, "temps", np.column_stack([COIL, ROOM]))
    matlab(file, "phase", PHASE)


def groups(file):
    file["run1/daq/t"], file["run1/daq/T_coil"], file["run1/I"] = T, COIL, PHASE
    file["run1/daq/T_coil"].attrs["units"] = "degC"


def compound(file):
    rows = np.zeros(N, dtype=[("t", "f8"), ("coil", "f8"), ("phase", "f8"), ("mark", "S4")])
    rows["t"], rows["coil"], rows["phase"] = T, COIL, PHASE
    file["table"] = rows


HDF5 = {
    nested: ("log.t [s]", "log.coil [degC]", "log.phase [A]"),
    array_of_structs: ("trial.X(1).Data [s]", "T_coil", "I_u"),
    matrix: ("t", "temps(:,1) [degC]", "phase [A]"),
    groups: ("run1/daq/t [s]", "run1/daq/T_coil", "run1/I [A]"),
    compound: ("table/t [s]", "table/coil [degC]", "table/phase [A]"),
}


@pytest.mark.parametrize("write", HDF5)
def test_what_hdf5_nests(tmp_path, write):
    path = tmp_path / "run.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        write(file)
    channels = ("time_s", "winding_degC", "phase_current_A")
    holds_the_run(path, dict(zip(channels, HDF5[write], strict=True)))


FRAMES = {
    "candump": "({t:.6f}) vcan0 {id:03X}#{data}\n",
    "candump, CAN FD": "({t:.6f}) can1 {id:08X}##1{data}\n",
    "candump on the screen": "  can0  {id:03X}   [8]  {bytes}\n",
    "ASC": "   {t:.6f} 1  {id:X}             Rx   d 8 {bytes}  Length = 245000 BitCount = 126\n",
    "ASC, CAN FD": "   {t:.6f} CANFD   1 Rx  {id:X}  Msg  0 0 8  8 {bytes}  130000  130   303000\n",
    "TRC 1.1": "{i:6d})  {t:10.1f}  Rx     {id:04X}  8  {bytes}\n",
    "TRC 2.1": "{i:7d} {t:13.3f} DT 1     {id:04X} Rx -  8    {bytes}\n",
    "BUSMASTER": "16:58:41:{i:04d} Rx 1 0x{id:X} s 8 {bytes}\n",
    "Kvaser": "0    {id:08X}       8  {bytes}    {t:12.6f} R\n",
    "bytes as cells": "{t:.6f},{id:08X},false,Rx,0,8,{cells},\n",
    "a cell of bytes": "{t:.4f};1;{id:X};0;8;8;0;0;0;{data}\n",
}
HEADS = {
    "ASC": "date Mon Mar 17 09:00:00.000 am 2025\nbase hex  timestamps absolute\n",
    "TRC 1.1": ";$FILEVERSION=1.1\n;$STARTTIME=45733.3751\n;\n",
    "TRC 2.1": ";$FILEVERSION=2.1\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n",
    "BUSMASTER": "***BUSMASTER Ver 3.2.2***\n***PROTOCOL CAN***\n",
    "bytes as cells": "Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\n",
    "a cell of bytes": "TimestampEpoch;BusChannel;ID;IDE;DLC;DataLength;Dir;EDL;BRS;DataBytes\n",
}


@pytest.mark.parametrize("member", FRAMES)
def test_a_log_of_bus_frames_must_be_decoded_first(tmp_path, member):
    rng = np.random.default_rng(3)
    text = HEADS.get(member, "")
    for i in range(40):
        data = rng.integers(0, 256, 8).astype("u1").tobytes().hex(" ").upper()
        forms = {"data": data.replace(" ", ""), "cells": data.replace(" ", ","), "bytes": data}
        text += FRAMES[member].format(i=i, t=1742201.5 + 0.01 * i, id=0x120 + i % 5, **forms)
    path = tmp_path / "log.txt"
    path.write_text(text)
    with pytest.raises(InputError, match=r"raw bus frames .*extract_bus_logging"):
        survey(path)


def test_a_binary_log_of_bus_frames_must_be_decoded_first(tmp_path):
    path = tmp_path / "log.blf"
    path.write_bytes(b"LOGG" + bytes(140))
    with pytest.raises(InputError, match=r"raw bus frames \(BLF\).*can_logconvert"):
        survey(path)


@pytest.mark.parametrize(
    "text",
    [
        "No,n,a,b,c\n"
        + "".join(f"{i},{100 + i},3,{10 + i},{20 + i},{30 + i}\n" for i in range(40)),
        "t,id,T1,T2\n" + "".join(f"{i},7,2,{20 + i},{30 + i}\n" for i in range(40)),
    ],
)
def test_a_table_of_whole_numbers_is_no_log_of_frames(text):
    assert kind_of_frames(text) == ""


def frames_and_signals(path, *, with_signals):
    asammdf = pytest.importorskip("asammdf")
    file = asammdf.MDF(version="4.10")
    names = ("CAN_DataFrame.ID", "CAN_DataFrame.DLC", "CAN_DataFrame.Dir", "LIN_Frame.ID")
    file.append([asammdf.Signal(np.arange(N) % 7, T, name=name) for name in names])
    if with_signals:
        file.append([asammdf.Signal(COIL, T, name="winding_degC", unit="degC")])
    file.save(path)
    file.close()
    return path


def test_an_mdf_of_frames_must_be_decoded_first(tmp_path):
    with pytest.raises(InputError, match=r"raw bus frames \(MDF\).*extract_bus_logging"):
        survey(frames_and_signals(tmp_path / "raw.mf4", with_signals=False))


def test_frames_beside_signals_are_offered_for_no_channel(tmp_path):
    found = survey(frames_and_signals(tmp_path / "both.mf4", with_signals=True))
    assert [one.channel for one in found.recognised if one.channel != "time_s"] == ["winding_degC"]
    assert not any(one.proposals for one in found.free)
