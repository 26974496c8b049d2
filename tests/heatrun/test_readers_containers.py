"""MATLAB files, signals in structs, groups and matrices, and raw bus frames."""

import struct

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


def column(values):
    return values[:, None]


SERIES = {"coil": {"Time": T, "Data": COIL, "Units": "degC"}, "phase": {"Time": T, "Data": PHASE}}


def holds_the_run(path, columns):
    record = read_record(path, Motor("M", columns=columns))
    np.testing.assert_array_equal(record.time_s, T)
    np.testing.assert_array_equal(record["winding_degC"], COIL)
    np.testing.assert_array_equal(record["phase_current_A"], PHASE)


@pytest.mark.parametrize("compressed", [False, True])
def test_times_and_data_of_a_timeseries(tmp_path, compressed):
    path = tmp_path / "run.mat"
    scipy.io.savemat(path, SERIES, do_compression=compressed, oned_as="column")
    columns = {"time_s": "coil.Time [s]", "winding_degC": "coil.Data",
               "phase_current_A": "phase.Data [A]"}  # fmt: skip
    holds_the_run(path, columns)


def test_names_in_structs_are_recognised(tmp_path):
    path = tmp_path / "run.mat"
    fields = {"time_s": T, "winding_degC": COIL, "ambient_degC": ROOM, "phase_current_A": PHASE}
    scipy.io.savemat(path, {"log": fields})
    found = {one.channel: one.column for one in survey(path).recognised}
    assert found == {name: f"log.{name}" for name in fields}


def test_a_cell_of_texts_names_the_columns_of_the_matrix_beside_it(tmp_path):
    names = np.array(["T_winding [degC]", "I [A]"], dtype=object)
    rows = np.vstack((np.arange(50.0), np.full(50, 3.0)))
    scipy.io.savemat(tmp_path / "m.mat", {"t": np.arange(50.0), "data": rows, "names": names})
    table = read_raw(tmp_path / "m.mat")
    assert [one.label for one in table.columns[1:]] == ["T_winding", "I"]
    assert not table.findings


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


def matlab(group, name, value):
    """Write a variable as MATLAB 7.3 does: its columns one behind the other, texts as numbers."""
    is_text = isinstance(value, str)
    data = np.array([[ord(c)] for c in value], dtype="u2") if is_text else np.atleast_2d(value)
    item = group.create_dataset(name, data=data if is_text or np.ndim(value) < 2 else data.T)
    item.attrs["MATLAB_class"] = np.bytes_("char" if is_text else "double")
    return item


def array_of_structs(file):
    """Write Y(k) as references into a group of MATLAB's own."""
    refs, trial = file.create_group("#refs#"), file.create_group("trial")
    trial.attrs["MATLAB_class"] = np.bytes_("struct")
    parts = {"X": [(T, "", "s")], "Y": [(COIL, "T_coil", "degC"), (PHASE, "I_u", "A")]}
    for part, signals in parts.items():
        group = trial.create_group(part)
        group.attrs["MATLAB_class"] = np.bytes_("struct")
        for k, key in enumerate(("Data", "Name", "Unit")):
            items = [matlab(refs, f"{part}{key}{i}", (one[k] or "-") if k else one[k])
                     for i, one in enumerate(signals)]  # fmt: skip
            group.create_dataset(key, data=np.array([[i.ref for i in items]], dtype=h5py.ref_dtype))


def matrix(file):
    matlab(file, "t", T)
    matlab(file, "temps", np.column_stack([COIL, ROOM]))
    matlab(file, "phase", PHASE)


HDF5 = {
    array_of_structs: ("trial.X(1).Data [s]", "T_coil", "I_u"),
    matrix: ("t", "temps(:,1) [degC]", "phase [A]"),
}


@pytest.mark.parametrize("write", HDF5)
def test_what_hdf5_nests(tmp_path, write):
    path = tmp_path / "run.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        write(file)
    channels = ("time_s", "winding_degC", "phase_current_A")
    holds_the_run(path, dict(zip(channels, HDF5[write], strict=True)))


FRAMES = {
    "candump, CAN FD": "({t:.6f}) can1 {id:08X}##1{data}\n",
    "candump on the screen": "  can0  {id:03X}   [8]  {bytes}\n",
    "ASC, CAN FD": "   {t:.6f} CANFD   1 Rx  {id:X}  Msg  0 0 8  8 {bytes}  130000  130   303000\n",
    "TRC 1.1": "{i:6d})  {t:10.1f}  Rx     {id:04X}  8  {bytes}\n",
    "TRC 2.1": "{i:7d} {t:13.3f} DT 1     {id:04X} Rx -  8    {bytes}\n",
    "BUSMASTER": "16:58:41:{i:04d} Rx 1 0x{id:X} s 8 {bytes}\n",
    "Kvaser": "0    {id:08X}       8  {bytes}    {t:12.6f} R\n",
}
HEADS = {
    "TRC 1.1": ";$FILEVERSION=1.1\n;$STARTTIME=45733.3751\n;\n",
    "TRC 2.1": ";$FILEVERSION=2.1\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n",
    "BUSMASTER": "***BUSMASTER Ver 3.2.2***\n***PROTOCOL CAN***\n",
}


@pytest.mark.parametrize("member", FRAMES)
def test_a_log_of_bus_frames_must_be_decoded_first(tmp_path, member):
    rng = np.random.default_rng(3)
    text = HEADS.get(member, "")
    for i in range(40):
        data = rng.integers(0, 256, 8).astype("u1").tobytes().hex(" ").upper()
        forms = {"data": data.replace(" ", ""), "bytes": data}
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


NUM = 40
SIGNALS = {
    "t": np.arange(NUM) * 0.1,
    "Is": np.full(NUM, 100.0),
    "Pd": np.linspace(0.0, 900.0, NUM),
    "Te": np.full(NUM, 22.0),
    "Tw_m": np.linspace(22.0, 40.0, NUM),
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
    assert np.array_equal(record["ambient_degC"], np.full(NUM, 21.5))
    assert any("ambient_degC" in note and "constant" in note for note in record.notes)


def test_what_is_no_vector_is_left_out_with_a_finding(tmp_path):
    path = prova(
        tmp_path / "prova.mat",
        run=np.arange(7.0),
        matrix=np.ones((4, 4)),
        info={"bench": "A"},
        text="hello",
        wave=np.ones(NUM) * 1j,
    )
    table = read_raw(path)
    assert {column.name for column in table.columns} == set(SIGNALS)
    (finding,) = table.findings
    assert finding.values == {"count": 5, "length": NUM}
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
            assert read_raw(path).num_rows == NUM
        except InputError:
            refused += 1
    assert refused > 150  # every cut one at the least, but for those that end between variables
