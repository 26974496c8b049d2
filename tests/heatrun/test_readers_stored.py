"""HDF5, netCDF and Parquet: units, scaling and marks beside the numbers are followed."""

import h5py
import numpy as np
import pandas as pd
import pytest
import scipy.io
from scipy.io import netcdf_file

from heatrun.errors import InputError
from heatrun.readers.read import read_raw, read_record
from heatrun.record.motor import Motor

pyarrow = pytest.importorskip("pyarrow")

N = 50
MINUTES = np.arange(N, dtype=float)
KELVIN = np.linspace(293.15, 353.15, N)

# name: stored numbers and attributes; each truth below is written out by hand
VARIABLES = {
    "time": (MINUTES, {"units": "minutes since 2024-01-01 12:00:00"}),
    "T_winding": (KELVIN, {"units": "K"}),
    "losses_W": (np.full(N, 0.5), {"units": "W"}),
    "phase_current_A": (np.arange(N, dtype="i2"), {"scale_factor": 0.5, "add_offset": 10.0}),
}
MOTOR = Motor("M", columns={"winding_degC": "T_winding"})


def hdf5(path, variables):
    with h5py.File(path, "w") as file:
        for name, (values, attributes) in variables.items():
            item = file.create_dataset(name, data=values)
            for key, value in attributes.items():
                item.attrs[key] = value
    return path


def netcdf3(path, variables):
    with netcdf_file(str(path), "w") as file:
        file.createDimension("time", N)
        for name, (values, attributes) in variables.items():
            values = np.asarray(values)
            item = file.createVariable(name, values.dtype, ("time",) if values.ndim else ())
            item[...] = values
            for key, value in attributes.items():
                setattr(item, key, value)
    return path


def parquet(path, variables):
    import pyarrow.parquet

    fields, arrays = [], []
    for name, (values, attributes) in variables.items():
        array = pyarrow.array(np.broadcast_to(values, (N,)).copy())
        stated = {key: str(value) for key, value in attributes.items()}
        fields.append(pyarrow.field(name, array.type, metadata=stated))
        arrays.append(array)
    pyarrow.parquet.write_table(pyarrow.table(arrays, schema=pyarrow.schema(fields)), path)
    return path


@pytest.fixture(params=[hdf5, netcdf3, parquet], ids=["hdf5", "netcdf3", "parquet"])
def write(request, tmp_path):
    return lambda variables: request.param(tmp_path / "test.nc", variables)


def test_units_scaling_and_times_are_followed(write):
    record = read_record(write(VARIABLES), MOTOR)
    assert np.array_equal(record.time_s, 60.0 * MINUTES)
    np.testing.assert_allclose(record["winding_degC"], KELVIN - 273.15, atol=1e-10)
    assert record["phase_current_A"].tolist() == [10.0 + 0.5 * i for i in range(N)]
    notes = " ".join(record.notes)
    assert "minutes since 2024-01-01 12:00:00" in notes
    assert "stored value times 0.5 plus 10" in notes


@pytest.mark.parametrize("key", ["units", "unit", "Unit", "Units", "UNITS"])
def test_the_unit_under_any_usual_key(write, key):
    torque = {"torque": (np.ones(N), {key: "mNm"})}
    record = read_record(write(VARIABLES | torque), MOTOR)
    assert record["torque_Nm"].tolist() == [1e-3] * N


@pytest.mark.parametrize(
    ("unit", "seconds"),
    [("hours since 2024-01-01", 3600.0), ("days since 1970-01-01 00:00", 86400.0),
     ("seconds since 2024-01-01T00:00:00Z", 1.0), ("milliseconds since 2024-01-01", 1e-3),
     ("h", 3600.0), ("ms", 1e-3), ("minutes", 60.0)],
)  # fmt: skip
def test_units_of_time(write, unit, seconds):
    record = read_record(write(VARIABLES | {"time": (MINUTES, {"units": unit})}), MOTOR)
    np.testing.assert_allclose(record.time_s, seconds * MINUTES, rtol=1e-12)


@pytest.mark.parametrize(
    ("attributes", "problem"),
    [
        ({"units": "months since 2024-01-01"}, "no fixed length"),
        ({"units": "fortnights"}, "'fortnights' is not known"),
        ({"units": "m"}, "not known"),
        ({"gain": 2.0}, "gain = 2"),
        ({"units": "s", "Scale": 1000.0}, "scale = 1000"),
        ({"scale_factor": "ten"}, "scale_factor = 'ten'"),
        ({"units": "s", "unit": "min"}, "two units, s and min"),
    ],
)  # fmt: skip
def test_what_is_not_understood_is_an_error_where_it_is_used(write, attributes, problem):
    with pytest.raises(InputError, match=problem):
        read_record(write(VARIABLES | {"time": (MINUTES, attributes)}), MOTOR)
    unused = VARIABLES | {"counter": (MINUTES, attributes)}
    assert read_record(write(unused), MOTOR).unused == ("counter",)


def test_neutral_and_spoken_attributes_are_no_problem(write):
    attributes = {"units": "W", "gain": 1.0, "offset": 0.0, "calibration_date": "2024-01-01",
                  "scale": "linear", "long_name": "losses"}  # fmt: skip
    record = read_record(write(VARIABLES | {"losses_W": (np.ones(N), attributes)}), MOTOR)
    assert record["losses_W"].tolist() == [1.0] * N


def test_marks_of_missing_values(write):
    stored = np.arange(N, dtype="i2")
    stored[3], stored[4], stored[5] = -999, 999, 700
    marks = {"_FillValue": np.int16(-999), "missing_value": np.int16(999), "valid_max": 600}
    marks |= {"scale_factor": 0.1, "units": "W"}
    record = read_record(write(VARIABLES | {"losses_W": (stored, marks)}), MOTOR)
    assert np.flatnonzero(np.isnan(record["losses_W"])).tolist() == [3, 4, 5]
    assert record["losses_W"][10] == pytest.approx(1.0)
    assert any("3 values that the file marks as missing" in note for note in record.notes)


INTEGERS = np.arange(N, dtype="i1")
INTEGERS[1], INTEGERS[2] = -56, -1
UNSIGNED = {"_Unsigned": "true", "_FillValue": np.int8(-1), "units": "W"}
MISSING = {
    "a mark that a short float cannot hold": (
        hdf5, np.where(MINUTES == 7.0, -9999.9, 1.0).astype("f4"), {"_FillValue": -9999.9}, 7),
    "what netCDF stores where nothing was written": (
        netcdf3, np.where(MINUTES == 9.0, 9.969209968386869e36, 1.0).astype("f4"), {"units": "W"},
        9),
    "unsigned numbers of netCDF": (netcdf3, INTEGERS, UNSIGNED, 2),
}  # fmt: skip


@pytest.mark.parametrize("case", MISSING)
def test_what_is_stored_for_no_value(tmp_path, case):
    write, stored, marks, row = MISSING[case]
    path = write(tmp_path / "test.nc", VARIABLES | {"losses_W": (stored, marks)})
    losses = read_record(path, MOTOR)["losses_W"]
    assert np.flatnonzero(np.isnan(losses)).tolist() == [row]
    if marks is UNSIGNED:
        assert losses[:2].tolist() == [0.0, 200.0]


@pytest.mark.parametrize("name", ["torque_mNm", "torque [mNm]", "torque (mNm)"])
def test_a_name_against_the_unit_beside_it_is_a_question(tmp_path, name):
    for write in (hdf5, parquet):  # classic netCDF has no such names
        path = write(tmp_path / "test.nc", VARIABLES | {name: (np.full(N, 2.0), {"units": "Nm"})})
        with pytest.raises(InputError, match=r"name says mNm, the .* Nm\.") as caught:
            read_record(path, MOTOR)
        for chosen, torque in (("mNm", 2e-3), ("Nm", 2.0)):
            answer = f"{name} [{chosen}]"
            assert f'torque_Nm = "{answer}"' in caught.value.remedy
            columns = {"winding_degC": "T_winding", "torque_Nm": answer}
            record = read_record(path, Motor("M", columns=columns))
            assert record["torque_Nm"].tolist() == [torque] * N


@pytest.mark.parametrize(
    ("name", "unit"), [("P_loss_W", "watt"), ("T_s", "degC"), ("P [kW]", "kW")]
)
def test_a_name_that_agrees_is_none(tmp_path, name, unit):
    table = read_raw(hdf5(tmp_path / "test.h5", VARIABLES | {name: (np.ones(N), {"units": unit})}))
    assert all(column.question is None for column in table.columns)


@pytest.mark.parametrize(
    "spelling", ["degree_Celsius", "degrees_celsius", "degreesC", "°C", b"degC"]
)
def test_spellings_of_netcdf(tmp_path, spelling):
    stored = VARIABLES | {"T_winding": (KELVIN, {"units": spelling})}
    record = read_record(hdf5(tmp_path / "test.nc", stored), MOTOR)
    assert np.array_equal(record["winding_degC"], KELVIN)


def test_a_constant_with_a_unit_keeps_it(write):
    stored = VARIABLES | {"ambient": (np.float64(295.15), {"units": "K"})}
    record = read_record(write(stored), Motor("M", columns={"ambient_degC": "ambient"}))
    np.testing.assert_allclose(record["ambient_degC"], 22.0, atol=1e-10)


def test_a_dimension_of_netcdf_4_without_values_is_no_column_of_zeros(tmp_path):
    path = hdf5(tmp_path / "test.nc", VARIABLES)
    with h5py.File(path, "a") as file:
        del file["time"]
        item = file.create_dataset("time", data=np.zeros(N, dtype=">f4"))
        item.attrs["NAME"] = np.bytes_(
            f"This is a netCDF dimension but not a netCDF variable. {N:9}"
        )
        item.attrs["CLASS"] = np.bytes_("DIMENSION_SCALE")
    with pytest.raises(InputError, match="no time column"):
        read_record(path, MOTOR)


def test_units_that_pandas_keeps_for_a_frame(tmp_path):
    frame = pd.DataFrame({"time_s": MINUTES, "torque": np.ones(N)})
    frame.attrs["units"] = {"torque": "mNm"}
    path = tmp_path / "test.parquet"
    frame.to_parquet(path)
    if b"PANDAS_ATTRS" in path.read_bytes():  # from pandas 2.1 on
        assert read_record(path)["torque_Nm"].tolist() == [1e-3] * N


def test_a_bomb_in_classic_netcdf(tmp_path):
    path = netcdf3(tmp_path / "test.nc", VARIABLES)
    whole = path.read_bytes()
    size = N.to_bytes(4, "big")
    path.write_bytes(whole.replace(size, (2**31 - 2).to_bytes(4, "big"), 1))
    with pytest.raises(InputError):
        read_raw(path)


def test_a_time_without_end_in_classic_netcdf(tmp_path):
    path = tmp_path / "test.nc"
    with netcdf_file(str(path), "w") as file:
        file.createDimension("time", None)
        for name, unit in (("time", "h"), ("T_winding", "K")):
            item = file.createVariable(name, "f4", ("time",))
            item[:] = np.arange(300.0, 300.0 + N)
            item.units = unit
    record = read_record(path, MOTOR)
    assert record.time_s[1] == 3600.0
    np.testing.assert_allclose(record["winding_degC"], np.arange(N) + 26.85, atol=1e-9)


def test_netcdf_of_64_bit_data_is_named(tmp_path):
    path = tmp_path / "test.nc"
    path.write_bytes(b"CDF\x05" + bytes(100))
    with pytest.raises(InputError, match=r"64-bit data.*nccopy"):
        read_raw(path)


def test_a_description_states_the_unit_and_must_agree_with_it(tmp_path):
    def losses(name, attributes):
        variables = {**VARIABLES, "losses_W": (np.full(N, 0.5), {}), name: (np.ones(N), attributes)}
        return read_record(hdf5(tmp_path / "test.h5", variables), motor(name))["losses_W"]

    def motor(name):
        return Motor("M", columns={"winding_degC": "T_winding", "losses_W": name})

    assert losses("loss", {"long_name": "losses in kW"})[0] == 1000.0
    assert losses("loss", {"units": "kW", "long_name": "losses in kW"})[0] == 1000.0
    with pytest.raises(InputError, match="kW and W"):
        losses("loss", {"units": "kW", "long_name": "loss in W"})
    path = hdf5(tmp_path / "test.h5", {**VARIABLES, "P_W": (np.ones(N), {"units": "kW"})})
    found = read_record(path, motor("P_W"))
    assert "unit_beside_name" in {finding.id for finding in found.findings}


def test_a_description_of_times_since_a_date_is_no_contradiction(tmp_path):
    times = {"units": "minutes since 2024-01-01", "long_name": "elapsed time in min"}
    path = hdf5(tmp_path / "test.h5", {**VARIABLES, "time": (MINUTES, times)})
    assert read_record(path, MOTOR)["time_s"][1] == 60.0


@pytest.fixture
def path(tmp_path):
    return tmp_path / "run.parquet"


def test_columns_and_types(path):
    frame = pd.DataFrame(
        {
            "time_s": [0.0, 0.5, 1.0],
            "winding_degC": np.array([20.0, np.nan, 21.0], dtype=np.float32),
            "fan": [True, False, True],
            "count": pd.array([1, None, 3], dtype="Int64"),
            "state": ["RUN", "RUN", "STOP"],
        }
    )
    frame.to_parquet(path)
    table = read_raw(path)
    assert table.text_columns.keys() == {"state"}
    record = read_record(path)
    assert np.isnan(record["winding_degC"]).tolist() == [False, True, False]
    assert record["fan"].tolist() == [1.0, 0.0, 1.0]
    assert record.unused == ("count", "state")


@pytest.mark.parametrize("name", [None, "time", "timestamp"])
def test_an_index_of_dates_is_the_time(path, name):
    index = pd.date_range("2025-11-20 18:02:33", periods=4, freq="100ms", name=name, tz="UTC")
    pd.DataFrame({"winding_degC": np.arange(4.0)}, index=index).to_parquet(path)
    record = read_record(path)
    # 100 ms in nanoseconds is whole, so only the last product rounds
    np.testing.assert_allclose(record.time_s, [0.0, 0.1, 0.2, 0.3], atol=1e-15)
    assert any("2025-11-20T18:02:33" in note for note in record.notes)


def test_durations_and_regular_indices(path):
    frame = pd.DataFrame({"winding_degC": np.arange(3.0)})
    frame.index = pd.to_timedelta([1.0, 1.5, 2.5], unit="s")
    frame.to_parquet(path)
    assert read_record(path).time_s.tolist() == [0.0, 0.5, 1.5]
    frame.index = pd.RangeIndex(0, 6, 2, name="time [ms]")
    frame.to_parquet(path)
    np.testing.assert_allclose(read_record(path).time_s, [0.0, 0.002, 0.004], atol=1e-15)


def test_metadata_and_name_must_agree(path):
    import pyarrow.parquet

    def write(name: str) -> None:
        field = pyarrow.field(name, pyarrow.float64(), metadata={"unit": "kW"})
        schema = pyarrow.schema([pyarrow.field("time_s", pyarrow.float64()), field])
        table = pyarrow.table([[0.0, 1.0], [2.0, 3.0]], schema=schema)
        pyarrow.parquet.write_table(table, path)

    for name in ("losses [W]", "losses_W"):
        write(name)
        with pytest.raises(InputError, match="The name says W, the field's metadata kW"):
            read_record(path)
        motor = Motor("M", columns={"losses_W": f"{name} [kW]"})
        record = read_record(path, motor)
        assert record["losses_W"].tolist() == [2000.0, 3000.0]
        assert [finding.id for finding in record.findings] == ["unit_overridden"]
    write("losses_kW_mean")
    record = read_record(path)
    assert record["losses_W"].tolist() == [2000.0, 3000.0]
    assert record.mapping[1].unit_from == "stated"


def test_damaged_and_empty_files(path):
    pd.DataFrame({"a": [1.0, 2.0]}).to_parquet(path)
    path.write_bytes(path.read_bytes()[:-10])
    with pytest.raises(InputError, match="could not be read"):
        read_raw(path)
    pd.DataFrame({"a": np.empty(0)}).to_parquet(path)
    with pytest.raises(InputError, match="at least one row"):
        read_raw(path)


def test_groups_with_times_of_their_own_are_joined_by_them(tmp_path):
    fast_s = np.arange(0.0, 600.0, 1.0)
    slow_s = np.arange(0.0, 600.0, 10.0)
    groups = {
        "Slow/time": (slow_s, {"units": "s"}),
        "Slow/T_winding": (20.0 + 0.1 * slow_s, {"units": "degC"}),
        "Fast/time": (fast_s, {"units": "s"}),
        "Fast/losses_W": (fast_s, {"units": "W"}),
    }
    record = read_record(hdf5(tmp_path / "test.h5", groups), MOTOR)
    at = np.flatnonzero(np.isfinite(record["winding_degC"]))
    np.testing.assert_allclose(record["winding_degC"][at], 20.0 + 0.1 * record.time_s[at])
    np.testing.assert_allclose(record["losses_W"][1:-1], record.time_s[1:-1], atol=0.5)
    assert not [one for one in record.findings if one.id == "variables_left_out"]
    of_hours = groups | {"Slow/time": (slow_s / 3600.0, {"units": "h"})}
    table = read_raw(hdf5(tmp_path / "units.h5", of_hours))
    assert [one.id for one in table.findings] == ["variables_left_out"]


def test_a_group_of_another_length_is_to_be_a_file_of_its_own(tmp_path):
    short = {"Slow/ambient": (np.full(N // 2, 295.0), {"units": "K"})}
    table = read_raw(hdf5(tmp_path / "test.h5", VARIABLES | short))
    (finding,) = (one for one in table.findings if one.id == "variables_left_out")
    assert "Slow/ambient" in finding.message
    assert "a file of their own" in finding.remedy
    assert "save(" not in finding.remedy


ROWS = 12


def excel(path, table):
    table.to_excel(path, index=False)


def as_parquet(path, table):
    table.to_parquet(path)


def categories(path, table):
    kinds = {name: "category" for name in table if table[name].dtype.kind not in "fiub"}
    table.astype(kinds).to_parquet(path)


def in_h5(path, table):
    with h5py.File(path, "w") as file:
        for name in table:
            is_text = table[name].dtype.kind not in "fiub"
            file[name] = list(table[name]) if is_text else table[name].to_numpy()


def in_groups(path, table):
    """Write a group for each signal, with times and marks of its own."""
    with h5py.File(path, "w") as file:
        for name, end in (("Coil", ROWS), ("I_rms", ROWS - 4)):
            (marks,) = [column for column in table if column.startswith(f"{name}_")]
            held = {"time": "Time", "value": name, marks.removeprefix(f"{name}_"): marks}
            for key, column in held.items():
                values = table[column].to_numpy()[:end]
                file[f"{name}/{key}"] = list(values) if values.dtype.kind not in "fiub" else values


def records(path, table):
    kinds = [(name, "S40" if table[name].dtype.kind not in "fiub" else "f8") for name in table]
    with h5py.File(path, "w") as file:
        file["log"] = np.array([*map(tuple, table.to_numpy())], dtype=kinds)


def cells(path, table):
    kinds = {name: object for name in table if table[name].dtype.kind not in "fiub"}
    held = {name: table[name].to_numpy(dtype=kinds.get(name)) for name in table}
    scipy.io.savemat(path, held, oned_as="column")


def letters(path, table):
    scipy.io.savemat(path, {name: table[name].to_numpy() for name in table}, oned_as="column")


@pytest.mark.parametrize(
    ("write", "file"),
    [(excel, "run.xlsx"), (as_parquet, "run.parquet"), (categories, "run.parquet"),
     (in_h5, "run.h5"), (in_groups, "run.h5"), (records, "run.h5"), (cells, "run.mat"),
     (letters, "run.mat")],
)  # fmt: skip
@pytest.mark.parametrize(
    ("kind", "good", "bad"),
    [("quality", "Good", "Bad"), ("quality", 192, 24), ("quality", 0, -(2**31)),
     ("valid", True, False), ("invalid", 0, 1)],
)  # fmt: skip
def test_a_reading_marked_as_not_good_is_missing_whatever_the_format(
    tmp_path, write, file, kind, good, bad
):
    time = 2.0 * np.arange(ROWS)
    marks = [bad if 5 <= i < 8 else good for i in range(ROWS)]
    table = pd.DataFrame(
        {"Time": time, "Coil": 20.0 + time, "I_rms": 9.0 + np.sin(time),
         f"I_rms_{kind}": [good] * ROWS, f"Coil_{kind}": marks}
    )  # fmt: skip
    path = tmp_path / file
    write(path, table)
    coil, phase, clock = {
        in_groups: ("Coil/value", "I_rms/value", "time"),
        records: ("log/Coil", "log/I_rms", "log/Time"),
    }.get(write, ("Coil", "I_rms", "Time"))
    columns = {
        "winding_degC": f"{coil} [degC]", "phase_current_A": f"{phase} [A]",
        "time_s": f"{clock} [s]",
    }  # fmt: skip
    record = read_record(path, Motor("M", columns=columns))
    held = np.isfinite(record["winding_degC"])
    np.testing.assert_array_equal(record.time_s[held], np.delete(time, [5, 6, 7]))
    is_phase = np.isfinite(record["phase_current_A"])
    np.testing.assert_array_equal(is_phase[: held.size - 4], True)
    (finding,) = [one for one in record.findings if one.id == "unreadable_cells"]
    assert finding.values == {"count": 3, "first_line": 7 if write is excel else 6}
    assert not [one for one in record.findings if one.id == "variables_left_out"]


@pytest.mark.parametrize(
    ("write", "file"), [(as_parquet, "run.parquet"), (in_h5, "run.h5"), (letters, "run.mat")]
)
@pytest.mark.parametrize("per_second", [10**3, 10**9])
def test_counts_since_1970_are_times_in_any_format(tmp_path, write, file, per_second):
    counts = (1_741_093_200 + np.arange(ROWS)) * per_second
    write(tmp_path / file, pd.DataFrame({"time": counts, "Coil": 20.0 + np.arange(ROWS)}))
    record = read_record(tmp_path / file, Motor("M", columns={"winding_degC": "Coil [degC]"}))
    np.testing.assert_array_equal(record.time_s, np.arange(ROWS))
    assert (record.start, record.clock_s) == ("2025-03-04", 13 * 3600.0)
