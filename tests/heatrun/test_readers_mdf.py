"""MDF 4 files: rates, units, groups; unsorted, cut or hostile ones."""

import struct

import numpy as np
import pytest
from mdf_files import FAST, SLOW, drive_and_temperatures, signal, written

from heatrun.errors import InputError
from heatrun.motor.file import load_motor
from heatrun.readers.read import read_raw, read_record
from heatrun.record.motor import Motor


@pytest.fixture
def path(tmp_path):
    return tmp_path / "run.mf4"


def test_faster_channels_are_averaged_onto_the_winding(path):
    record = read_record(drive_and_temperatures(path))
    assert np.array_equal(record.time_s, SLOW)
    low, high = SLOW[1:-1] - 0.5, SLOW[1:-1] + 0.5
    square = 300.0**2 * (0.5 - (np.sin(2 * high) - np.sin(2 * low)) / 4.0)
    # Straight lines err by step²/12 times the curvature of the squares, 2·300² at most.
    most = 0.1**2 / 12.0 * 2.0 * 300.0**2
    np.testing.assert_allclose(record["phase_current_A"][1:-1] ** 2, square, atol=most)
    np.testing.assert_allclose(record["winding_degC"], 2.0 * SLOW + 20.0, atol=1e-12)
    is_valid = SLOW < 15.0
    np.testing.assert_allclose(record["losses_W"][1:15], 100.0 * SLOW[1:15], atol=1e-9)
    assert np.isnan(record["losses_W"]).tolist() == (~is_valid).tolist()
    (finding,) = record.findings
    assert finding.id == "raster_not_covered"
    assert finding.values["count"] == 5
    assert record.unused == ("state", "note")
    assert any("0.1 s (phase_current_A, losses_W)" in note for note in record.notes)


def test_slower_inputs_are_joined_and_the_winding_stays(path):
    written(
        path,
        ("Room", [signal("ambient_degC", 20.0 + SLOW[::5], SLOW[::5])]),
        ("Rig", [signal("winding_degC", SLOW**2)]),
    )
    record = read_record(path)
    assert np.array_equal(record.time_s, SLOW)
    assert np.array_equal(record["winding_degC"], SLOW**2)
    inner = SLOW[1:15]  # the last sample of the room stands at 15 s
    np.testing.assert_allclose(record["ambient_degC"][1:15], 20.0 + inner, atol=1e-12)
    assert np.isnan(record["ambient_degC"][16:]).all()
    assert [one.id for one in record.findings] == ["raster_joined", "raster_not_covered"]
    assert read_record(path, Motor("M", raster_s=5.0)).time_s.tolist() == [0.0, 5.0, 10.0, 15.0]


def test_a_step_can_be_given_and_not_a_finer_one(path):
    drive_and_temperatures(path)
    record = read_record(path, Motor("M", raster_s=5.0))
    assert record.time_s.tolist() == [0.0, 5.0, 10.0, 15.0]
    np.testing.assert_allclose(record["winding_degC"][1:3], [30.0, 40.0], atol=1e-12)
    with pytest.raises(InputError, match=r"raster_s = 0.5 s is finer than the 1 s .*'winding"):
        read_record(path, Motor("M", raster_s=0.5))


def test_the_motor_file_gives_the_step(path, tmp_path):
    file = tmp_path / "motor.toml"
    file.write_text('[motor]\nname = "M"\nraster_s = 5.0\n')
    motor = load_motor(file)
    assert read_record(drive_and_temperatures(path), motor).time_s.size == 4
    table = tmp_path / "run.csv"
    table.write_text("time_s,winding_degC\n0,20\n1,21\n2,22\n")
    record = read_record(table, motor)
    assert record.time_s.size == 3
    assert any("raster_s = 5 is for MDF and TDMS" in note for note in record.notes)
    file.write_text('[motor]\nname = "M"\nraster_s = -1\n')
    with pytest.raises(InputError, match="raster_s above 0"):
        load_motor(file)


def test_products_are_formed_before_averaging(path):
    wave = np.sin(2.0 * np.pi * FAST / 0.4)
    dq = [
        signal("u_d_V", 10.0 * wave, FAST), signal("i_d_A", 10.0 * wave, FAST),
        signal("u_q_V", 0.0 * FAST, FAST), signal("i_q_A", 0.0 * FAST, FAST),
        signal("speed_rpm", 0.0 * FAST, FAST), signal("torque_Nm", 0.0 * FAST, FAST),
    ]  # fmt: skip
    written(path, ("Drive", dq), ("Rig", [signal("winding_degC", SLOW)]))
    record = read_record(path)
    # u_d and i_d each average to 0; their product to 50, times 3/2. Straight lines between 4
    # samples per period hold 2/3 of the mean square of the amplitude.
    assert record["losses_W"][1:-1] == pytest.approx(75.0, rel=0.01)
    assert np.abs(record["u_d_V"][1:-1]).max() < 1.0
    assert not record.findings
    written(path, ("U", dq[::2]), ("I", [signal(one.name, one.samples[::2], FAST[::2])
                                         for one in dq[1::2]]),
            ("Rig", [signal("winding_degC", SLOW)]))  # fmt: skip
    assert "derived_from_means" in {finding.id for finding in read_record(path).findings}


def test_products_are_formed_before_averaging_beside_a_stated_shaft(path):
    current = 2.0 + 2.0 * np.sign(np.sin(2.0 * np.pi * FAST / 0.4 + 0.1))
    link = [signal("dc_voltage_V", 12.0 * current, FAST), signal("dc_current_A", current, FAST)]
    slow = [signal("winding_degC", SLOW)]
    stands = Motor("M", constants={"speed_rpm": 0.0})
    written(path, ("Supply", link), ("Rig", slow))
    record = read_record(path, stands)
    # half the time 48 V and 4 A; straight lines between 4 samples per period hold 5/6 of it
    assert record["losses_W"][1:-1] == pytest.approx(96.0, rel=0.2)
    assert record["losses_W"][1:-1].min() > 1.3 * 12.0 * 2.0**2
    assert not record.findings
    written(path, ("U", link[:1]), ("I", [signal("dc_current_A", current[::2], FAST[::2])]),
            ("Rig", slow))  # fmt: skip
    assert "derived_from_means" in {finding.id for finding in read_record(path, stands).findings}


def test_units_of_the_file_must_be_those_of_the_channel(path):
    written(path, ("Rig", [signal("winding_degC", SLOW, unit="Nm")]))
    with pytest.raises(InputError, match="Expected a unit of temperature, got Nm"):
        read_record(path)
    written(path, ("Rig", [signal("winding [degC]", SLOW, unit="K")]))
    motor = Motor("M", columns={"winding_degC": "winding [degC]"})
    assert np.array_equal(read_record(path, motor)["winding_degC"], SLOW)


@pytest.mark.parametrize(
    ("name", "unit", "unit_from", "said"),
    [
        ("P_kW", "", "name", None),
        ("P kW", "kW", "stated", None),
        ("[kW] P", "", "stated", None),
        ("P", "kW", "stated", None),
        ("P_kW", "W", "", "The name says kW, the unit beside it W"),
        ("P", "furlong", "", "The unit 'furlong' is not known"),
    ],
)
def test_units_of_names_and_of_the_file(path, name, unit, unit_from, said):
    written(path, ("Rig/A", [signal(name, SLOW, unit=unit), signal("winding_degC", SLOW)]))
    motor = Motor("M", columns={"losses_W": name})
    if said is None:
        record = read_record(path, motor)
        assert np.array_equal(record["losses_W"], 1000.0 * SLOW)
        assert record.mapping[0].unit_from == unit_from
        return
    with pytest.raises(InputError, match=said) as caught:
        read_record(path, motor)
    assert f'losses_W = "{name} [' in caught.value.remedy
    motor = Motor("M", columns={"losses_W": f"{name} [kW]"})
    assert np.array_equal(read_record(path, motor)["losses_W"], 1000.0 * SLOW)


def test_a_name_in_several_groups_asks_for_one(path):
    written(path, ("Left", [signal("T", SLOW, unit="degC")]), ("Right", [signal("T", 2 * SLOW)]))
    with pytest.raises(InputError, match=r"'Left/T' and 'Right/T' both stand .*\"Left/T\""):
        read_record(path, Motor("M", columns={"winding_degC": "T"}))
    motor = Motor("M", columns={"winding_degC": "Right/T [degC]"})
    assert np.array_equal(read_record(path, motor)["winding_degC"], 2 * SLOW)


@pytest.mark.parametrize("name", ["state", "note"])
def test_words_are_no_temperatures(path, name):
    drive_and_temperatures(path)
    with pytest.raises(InputError, match=f"'{name}' for winding_degC holds the text"):
        read_record(path, Motor("M", columns={"winding_degC": name}))


def test_a_formula_is_refused(path):
    formula = signal("winding_degC", SLOW, conversion={"formula": "X1**2"})
    written(path, ("Rig", [formula, signal("ambient_degC", SLOW)]))
    with pytest.raises(InputError, match=r"formula 'X1\*\*2'; formulas .* not evaluated"):
        read_record(path)
    record = read_record(path, Motor("M", columns={"winding_degC": "none"}))
    assert "winding_degC" in record.unused


def test_rates_need_times_that_increase(path):
    back = np.where(FAST > 10.0, FAST - 5.0, FAST)
    groups = [("Drive", [signal("losses_W", FAST, back)])]
    record = read_record(written(path, *groups))
    assert np.array_equal(record.time_s, back)
    written(path, *groups, ("Rig", [signal("winding_degC", SLOW)]))
    with pytest.raises(InputError, match=r"after 10 s comes 5.1 s"):
        read_record(path)


def test_read_raw_gives_every_channel_of_numbers(path):
    table = read_raw(drive_and_temperatures(path))
    names = ["time_s", "phase_current_A", "losses_W", "ambient_degC", "winding"]
    assert [column.name for column in table.columns] == names
    assert [column.unit for column in table.columns] == ["s", "A", "W", "degC", "K"]
    assert dict(table.text_columns) == {"state": "states in words", "note": "text"}


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
    yield "could not be read", patched(data, channel + 24, "<Q", group)
    yield "samples of", patched(data, about_group + 8, "<Q", 10**15)
    yield "a channel at bytes", patched(data, about_channel + 4, "<I", 2**31)
    times = links_of(data, blocks(data, b"##CN")[0])[-1] + 8
    assert data[times] == 2  # the channel of times
    yield "a channel at bytes", patched(data, times + 4, "<I", 60_000)
    yield "could not be read", patched(patched(data, about_channel + 8, "<I", 96),
                                       about_group + 24, "<I", 2**20)  # fmt: skip
    yield "ends beyond", patched(data, channel + 8, "<Q", 2**60)
    yield "ends beyond", patched(data, channel + 16, "<Q", 2**40)
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
