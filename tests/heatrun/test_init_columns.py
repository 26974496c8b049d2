"""Which columns `heatrun init` offers for a channel, in which order, and what stands above them."""

import tomllib
from pathlib import Path

import numpy as np
import pytest
import scipy.io
from drafted import (
    BEARING,
    CURRENT,
    HOUSING,
    LOAD,
    LOSSES,
    ROOM,
    TIME_S,
    WINDING,
    ZERO,
    named,
    note_on,
    offered,
    text_of,
)
from mdf_files import signal, written

from heatrun.init.draft import choices, draft
from heatrun.init.gaps import gaps
from heatrun.init.survey import survey
from heatrun.motor.file import parse_motor
from heatrun.readers.joined import read_test

BASE = {"time_s": TIME_S, "losses_W": LOSSES}
CHANNELS = {
    "CH1 [degC]": ZERO + 21.0,
    "CH2 [degC]": BEARING,
    "CH3 [degC]": ROOM,
    "CH4 [degC]": HOUSING,
    "CH5 [degC]": WINDING,
    "CH6 [degC]": ZERO,
}


COLD = ZERO + 22.0 + (np.arange(ZERO.size) == 5)
BROKEN = np.concatenate([[20.0, 800.0, 1300.0], ZERO[3:] + 1372.0])
HOT = 22.0 + 2.0 * (WINDING - 22.0)
SIGNED = np.where(CURRENT > 50.0, -20.0, 3.0)
ORDERS = {
    "the temperature that moves the most is first for the winding": (
        CHANNELS, "winding_degC", [f"CH{n} [degC]" for n in (5, 4, 2, 3, 1)],
        {'winding_degC = "CH5': "moves by 66 K, the most", 'winding_degC = "CH3': "stays"}),
    "a machine that cools moves as well": (
        {"CH1 [degC]": ROOM, "CH2 [degC]": HOUSING[::-1], "CH3 [degC]": WINDING[::-1]},
        "winding_degC", ["CH3 [degC]"], {}),
    "the coldest that stays is first for the ambient, and a channel of zeros is no room": (
        CHANNELS, "ambient_degC", [f"CH{n} [degC]" for n in (3, 2, 1, 4, 5)],
        {'ambient_degC = "CH3': "the coldest"}),
    "a phase current is never negative and varies": (
        {"CH1 [A]": ZERO + 2.5, "CH2 [A]": SIGNED, "CH3 [A]": CURRENT, "CH4 [A]": CURRENT / 9},
        "phase_current_A", ["CH3 [A]", "CH4 [A]", "CH2 [A]", "CH1 [A]"],
        {"CH2 [A]": "negative", "CH1 [A]": "throughout"}),
    "a name goes before values": (
        {"Brake [degC]": HOT, "T_Wckl [degC]": WINDING, "T_Raum [degC]": ROOM},
        "winding_degC", ["T_Wckl [degC]"], {}),
    "unless they contradict it": (
        {"Brake [degC]": HOT, "T_Wckl [degC]": ZERO + 21.0, "T_Raum [degC]": ROOM},
        "winding_degC", ["Brake [degC]", "T_Wckl [degC]"], {}),
    "an open thermocouple is no winding": (
        {"CH1 [degC]": BROKEN, "CH2 [degC]": WINDING},
        "winding_degC", ["CH2 [degC]", "CH1 [degC]"], {'winding_degC = "CH1': "outside"}),
    "units do not change the order": (
        {"CH1 [degF]": HOUSING * 1.8 + 32.0, "CH2 [K]": WINDING + 273.15, "CH3 [degC]": ROOM},
        "winding_degC", ["CH2 [K]", "CH1 [degF]", "CH3 [degC]"], {}),
    "nor that for the ambient": (
        {"CH1 [degF]": HOUSING * 1.8 + 32.0, "CH2 [K]": WINDING + 273.15, "CH3 [degC]": ROOM},
        "ambient_degC", ["CH3 [degC]"], {}),
    "a short cold record says nothing of the order": (
        {"CH1 [degC]": ROOM, "T_Wckl [degC]": COLD}, "winding_degC", ["T_Wckl [degC]"], {}),
}  # fmt: skip


@pytest.mark.parametrize("case", ORDERS)
def test_what_is_offered_stands_in_the_order_of_what_it_may_be(tmp_path, case):
    columns, channel, order, notes = ORDERS[case]
    text = text_of(named(tmp_path, BASE | columns))
    found = offered(text, channel)
    assert found[: len(order)] == order
    assert len(order) == 1 or len(found) == len(order)
    for name, said in notes.items():
        assert said in note_on(text, name)


def test_a_channel_that_stays_gives_the_number_of_the_room(tmp_path):
    text = text_of(named(tmp_path, BASE | CHANNELS))
    assert "ambient_degC = 0.0" not in text
    assert "ambient_degC = 21.0" in text


def test_what_does_not_grow_is_no_time(tmp_path):
    columns = {"Zeitkonstante [s]": WINDING, "Laufzeit [s]": TIME_S[::-1], "Messzeit [s]": TIME_S}
    text = text_of(named(tmp_path, columns | {"losses_W": LOSSES}))
    assert offered(text, "time_s")[0] in ("Messzeit [s]", "Zeitkonstante [s]")
    assert offered(text, "time_s")[-1] == "Laufzeit [s]"


WITH_CURRENT = BASE | {"phase_current_A": CURRENT, "ambient_degC": ROOM}
UVW = (WINDING + 1.5, WINDING, WINDING - 1.0)


def test_what_no_temperature_reaches_may_be_the_time_by_any_name(tmp_path):
    """ "ts" of a temperature reads so too; that of a clock counts seconds."""
    columns = {"ts": 4e5 + TIME_S, "losses_W": LOSSES, "I [A]": CURRENT, "T_w [degC]": WINDING}
    text = text_of(named(tmp_path, columns))
    assert offered(text, "time_s") == ["ts"]
    assert "ts" not in [*offered(text, "winding_degC"), *offered(text, "ambient_degC")]
    as_warm = text_of(named(tmp_path, {**BASE, "ts": WINDING}))
    assert offered(as_warm, "winding_degC") == ["ts"]


def taken(text: str, channel: str, side: str) -> str:
    """Remove the # in front of a line."""
    line = f'{channel} = "{side}"'
    assert f"# {line}" in text
    return text.replace(f"# {line}", line, 1)


@pytest.mark.parametrize(
    "names",
    [
        ("T_U [degC]", "T_V [degC]", "T_W [degC]"),
        ("Wicklung U [degC]", "Wicklung V [degC]", "Wicklung W [degC]"),
        ("PT100_1 [degC]", "PT100_2 [degC]", "PT100_3 [degC]"),
        ("Winding L1 (°C)", "Winding L2 (°C)", "Winding L3 (°C)"),
        ("TwU [degC]", "TwV [degC]", "TwW [degC]"),
        ("T1 [K]", "T2 [K]", "T3 [K]"),
    ],
)
def test_the_mean_of_the_phases_is_first_for_the_winding(tmp_path, names):
    shift = 273.15 if "[K]" in names[0] else 0.0
    columns = {name: values + shift for name, values in zip(names, UVW, strict=True)}
    path = named(tmp_path, {"PT100_4 [degC]": BEARING} | WITH_CURRENT | columns)
    text = text_of(path)
    side = offered(text, "winding_degC")[0]
    assert side == f"mean({', '.join(name.rpartition(' ')[0] for name in names)})"
    motor = parse_motor(taken(text, "winding_degC", side).encode(), "motor.toml")
    found = read_test(path, motor)["winding_degC"]
    np.testing.assert_allclose(found, np.mean(UVW, axis=0), atol=1e-2)


def test_the_unit_of_bare_names_is_assumed_in_the_mean_too(tmp_path):
    names = ("coil_U", "coil_V", "coil_W")
    path = named(tmp_path, WITH_CURRENT | dict(zip(names, UVW, strict=True)))
    text = text_of(path)
    assert offered(text, "winding_degC")[0] == "mean(coil_U, coil_V, coil_W)"
    motor = taken(text, "winding_degC", "mean(coil_U, coil_V, coil_W)")
    assert "winding_degC" in read_test(path, parse_motor(motor.encode(), "motor.toml"))


def test_the_same_letters_of_other_things_are_no_phases(tmp_path):
    """Umgebung, Vorlauf and Wicklung: T_U, T_V and T_W of a German bench."""
    columns = {"T_U [degC]": ROOM, "T_V [degC]": BEARING, "T_W [degC]": WINDING}
    del (base := dict(WITH_CURRENT))["ambient_degC"]
    text = text_of(named(tmp_path, base | columns))
    assert "mean(" not in text.split("\n[columns]\n")[1]
    assert offered(text, "winding_degC")[0] == "T_W [degC]"
    assert offered(text, "ambient_degC")[0] == "T_U [degC]"


def test_a_loose_sensor_is_not_averaged(tmp_path):
    columns = dict(zip(("T_U [degC]", "T_V [degC]", "T_W [degC]"), UVW, strict=True))
    columns["T_V [degC]"] = HOUSING
    text = text_of(named(tmp_path, WITH_CURRENT | columns))
    assert "mean(" not in text.split("\n[columns]\n")[1]


def test_three_of_the_housing_do_not_go_before_the_winding(tmp_path):
    columns = {f"T{n} [degC]": HOUSING + n / 10 for n in (1, 2, 3)} | {"T4 [degC]": WINDING}
    sides = offered(text_of(named(tmp_path, WITH_CURRENT | columns)), "winding_degC")
    assert sides[:2] == ["T4 [degC]", "mean(T1, T2, T3)"]


def test_channels_of_a_measurement_file_are_averaged_too(tmp_path):
    time = TIME_S
    logged = [signal(f"TC_Wdg_{p}", v, time, "°C") for p, v in zip("UVW", UVW, strict=True)]
    drive = [signal(name, v, time, "") for name, v in WITH_CURRENT.items() if name != "time_s"]
    path = tmp_path / "bench.mf4"
    written(path, ("Logger", logged), ("Drive", drive))
    text = text_of(path)
    side = "mean(TC_Wdg_U, TC_Wdg_V, TC_Wdg_W)"
    assert offered(text, "winding_degC")[0] == side
    motor = parse_motor(taken(text, "winding_degC", side).encode(), "motor.toml")
    assert "winding_degC" in read_test(path, motor)


WITH_WINDING = BASE | {"ambient_degC": ROOM, "winding_degC": WINDING}
CONTROLLER = {
    "Time (s)": TIME_S,
    "Voltage (V)": ZERO + 60.0,
    "Current (A)": CURRENT / 3.0,
    "Temperature (C)": BEARING,
    "eRPM": CURRENT * 40.0,
    "Motor Duty": ZERO + 3.0,
    "Phase Current (A)": ZERO,
    "Power (W)": CURRENT * 20.0,
}


@pytest.mark.parametrize(
    "name",
    ["eRPM", "ERPM", "erpm (1/min)", "Speed [eRPM]", "el. speed [rpm]", "n_el [1/min]",
     "Elektrische Drehzahl [1/min]", "omega_e [rad/s]", "electrical speed", "giri elettrici [rpm]"],
)  # fmt: skip
def test_an_electrical_speed_is_not_offered_as_the_shafts(tmp_path, name):
    text = text_of(named(tmp_path, WITH_WINDING | {name: CURRENT * 40.0}))
    assert offered(text, "speed_rpm") == []
    assert "pole pairs" in note_on(text, f"#   {name.partition(' [')[0]}")


@pytest.mark.parametrize("name", ["n [rpm]", "Drehzahl [1/min]", "el motor speed [rpm]", "wheel"])
def test_a_shafts_speed_still_is(tmp_path, name):
    found = survey(named(tmp_path, WITH_WINDING | {name: CURRENT * 40.0}))
    assert ("speed_rpm" in found.channels) == (name != "wheel")


def test_a_speed_in_hertz_says_why_it_is_none(tmp_path):
    text = text_of(named(tmp_path, WITH_WINDING | {"speed [Hz]": CURRENT}))
    assert offered(text, "speed_rpm") == []
    assert "electrical or the mechanical frequency" in text


def test_what_a_speed_controller_did_not_record_is_not_offered(tmp_path):
    path = named(tmp_path, CONTROLLER)
    text = text_of(path)
    assert offered(text, "phase_current_A") == offered(text, "speed_rpm") == []
    assert "0 A throughout" in note_on(text, "Phase Current")
    assert "pole pairs" in note_on(text, "eRPM")
    assert "no speed and no torque" in note_on(text, "Motor Duty")
    (gap,) = [one for one in gaps([survey(path)]) if one.channel == "phase_current_A"]
    assert "'Phase Current (A)' of test.csv holds 0 throughout" in gap.sentence
    assert "No column has" not in gap.sentence


@pytest.mark.parametrize("name", ["phase_current_A", "Iph [A]"])
@pytest.mark.parametrize("is_empty", [False, True])
def test_a_silent_column_is_told_and_not_taken_for_the_current(tmp_path, name, is_empty):
    path = tmp_path / "test.mat"
    values = ZERO + np.nan if is_empty else ZERO
    scipy.io.savemat(path, {**WITH_WINDING, name.partition(" ")[0]: values})
    found = survey(path)
    assert "phase_current_A" not in found.channels
    text = text_of(path)
    assert "1. [winding]" in text
    assert "2. [columns] phase_current_A" in text
    assert offered(text, "phase_current_A") == []
    wanted = "no values" if is_empty else "0 throughout"
    assert wanted in " ".join(text.replace("\n# ", " ").split())


def test_a_silent_channel_of_a_measurement_file_is_told(tmp_path):
    logged = [signal(name, v, TIME_S, "") for name, v in WITH_WINDING.items() if name != "time_s"]
    path = tmp_path / "bench.mf4"
    written(path, ("Logger", [*logged, signal("phase_current_A", ZERO, TIME_S, "A")]))
    assert "phase_current_A" not in survey(path).channels
    assert "holds 0 throughout" in " ".join(text_of(path).replace("\n# ", " ").split())


def test_a_cooling_record_beside_a_heat_run_leaves_nothing_missing(tmp_path):
    hot = named(tmp_path, WITH_WINDING | {"phase_current_A": CURRENT})
    cold = named(tmp_path, WITH_WINDING | {"phase_current_A": ZERO, "losses_W": ZERO}, "cold.csv")
    found = [survey(hot), survey(cold)]
    assert [one.place for one in gaps(found)] == ["[winding] phase_resistance_ohm"]
    assert "0 throughout" in note_on(text_of(hot, cold), "phase_current_A from column")


def test_two_columns_of_one_name_are_told_apart(tmp_path):
    """The printed worksheet has `Ieq DC` twice, in A and in V of another circuit."""
    from openpyxl import Workbook

    book = Workbook()
    sheet = book.active
    assert sheet is not None
    sheet.append(["t", "Ieq DC", "Ieq DC"])
    sheet.append(["[s]", "[A]", "[A]"])
    for second in range(20):
        sheet.append([second, second, 100 + second])
    book.save(tmp_path / "test.xlsx")
    free = survey(tmp_path / "test.xlsx").free
    assert [(one.low, one.high) for one in free] == [(0.0, 19.0), (100.0, 119.0)]


@pytest.mark.parametrize(
    ("column", "is_offered"),
    [("P_el [W]", True), ("coppia [Nm]", False), ("P_mech [kW]", False), ("n [1/min]", False)],
)
def test_a_shaft_that_stands_is_offered_where_none_was_recorded(tmp_path, column, is_offered):
    columns = {name: WITH_WINDING[name] for name in WITH_WINDING if name != "losses_W"}
    text = text_of(named(tmp_path, columns | {column: CURRENT}))
    assert ("0 where the rotor stands" in text) == is_offered


COMPLETE = WITH_CURRENT | {"winding_degC": WINDING}


def winding(text: str) -> dict[str, float]:
    """Return what [winding] would say if its drafted lines were confirmed."""
    part = text.split("\n[winding]\n")[1].split("\n\n")[0]
    keys = ("phase_resistance_ohm", "reference_temperature_degC")
    lines = [line.removeprefix("# ") for line in part.split("\n") if " = " in line]
    said = [line for line in lines if line.startswith(keys) and "  # from" in line]
    return tomllib.loads("\n".join(said))


WORKSHEET = (
    "DATI PER LA STIMA DEI PARAMETRI TERMICI\n"
    "Tamb med: 19,3577 °C Ceq, w: 666,75 J/K\n"
    "Ro rif: 1 ohm Rs: 0,0062 ohm Ceq, sr: 15060,1 J/K\n"
    "To rif: 20 °C Ts: 25 °C Req, w: 0,14485 K/W\n"
    "B: 234,5 °C Req, sr: 0,11625 K/W\n\n"
)


def test_the_head_of_the_worksheet_gives_the_phase_resistance(tmp_path):
    path = named(tmp_path, COMPLETE, head=WORKSHEET)
    text = text_of(path)
    assert winding(text) == {"phase_resistance_ohm": 0.0062, "reference_temperature_degC": 25.0}
    # a proposal: nothing is set
    assert "\nphase_resistance_ohm" not in text
    assert "put in the number, such as 0.0062" not in text
    (gap,) = gaps([survey(path)])
    assert "0.0062 Ω" in gap.sentence


@pytest.mark.parametrize(
    ("line", "ohm", "degC"),
    [
        ("Rs: 0.0062 ohm", 0.0062, None),
        ("Rs;0,0062;ohm", 0.0062, None),
        ("Rs [mOhm];6,2", 0.0062, None),
        ("Phasenwiderstand R20 = 6,2 mΩ", 0.0062, 20.0),
        ("Phase resistance (25 °C): 0.0062 Ω", 0.0062, 25.0),
        ("R_ph = 6.2e-3 Ohm @ 22.5 °C", 0.0062, 22.5),
        ("# Stator resistance: 6.2 mohm at 25 degC", 0.0062, 25.0),
        ("Resistenza di fase: 0,0062 ohm a 20 °C", 0.0062, 20.0),
        ("Strangwiderstand bei 20 °C: 0,0062 Ohm", 0.0062, 20.0),
    ],
)
def test_forms_of_a_stated_resistance(tmp_path, line, ohm, degC):
    said = winding(text_of(named(tmp_path, COMPLETE, head=f"Title\n{line}\n\n")))
    assert said.pop("phase_resistance_ohm") == pytest.approx(ohm, rel=1e-12)
    assert said == ({} if degC is None else {"reference_temperature_degC": degC})


@pytest.mark.parametrize(
    "line",
    [
        "Ro rif: 1 ohm",
        "R_UV = 0.0124 ohm",
        "Phase resistance line-to-line: 0.0124 ohm",
        "Klemmenwiderstand 12,4 mOhm",
        "Isolation: 500 MOhm",
        "Rs232: 9600",
        "Rs: 0 ohm",
        "Shunt Rs1 0.001",
        "Insulation resistance Rs: 500 MOhm",
    ],
)
def test_other_resistances_are_not_offered(tmp_path, line):
    text = text_of(named(tmp_path, COMPLETE, head=f"Title\n{line}\n\n"))
    assert winding(text) == {}
    assert "# phase_resistance_ohm =    # put in the number" in text


def test_two_values_are_both_offered(tmp_path):
    text = text_of(named(tmp_path, COMPLETE, head="Rs: 0.0062 ohm\nR_ph: 0.0071 ohm\n\n"))
    assert text.count("# phase_resistance_ohm = 0.00") == 2


def test_a_scalar_of_a_mat_file_is_offered(tmp_path):
    path = tmp_path / "test.mat"
    scipy.io.savemat(path, {**COMPLETE, "Rs": 0.0062, "Tref": 25.0})
    said = winding(text_of(path))
    assert said == {"phase_resistance_ohm": 0.0062, "reference_temperature_degC": 25.0}


@pytest.fixture
def surveys(tmp_path: Path):
    """A record whose logger has no name for two of its sensors."""
    t = np.arange(0.0, 3600.0, 20.0)
    load = np.where(t < 1800.0, 1.0, 0.0)
    warm = np.cumsum(load - 0.5) * 0.4
    columns = {"time [s]": t, "I_ph": 80.0 * load, "Losses [W]": 500.0 * load + 1.0,
               "Room [°C]": 21.0 + 0.001 * t,
               "Probe 7": 25.0 + warm, "Probe 8": 22.0 + 0.2 * warm}  # fmt: skip
    rows = zip(*(values.tolist() for values in columns.values()), strict=True)
    text = "\n".join((",".join(columns), *(",".join(f"{v:.3f}" for v in row) for row in rows)))
    path = tmp_path / "run.csv"
    path.write_text(text)
    return [survey(path)]


def test_a_column_is_offered_where_unit_and_name_allow_it(surveys):
    found = {each.channel: each for each in choices(surveys)}
    assert list(found)[:5] == ["time_s", "phase_current_A", "losses_W", "ambient_degC",
                               "winding_degC"]  # fmt: skip
    assert next(iter(found["losses_W"].sides)) == "Losses [W]"
    assert {"Probe 7", "Probe 8", "Room [°C]"} <= set(found["winding_degC"].sides)
    assert not any("Losses" in side for side in found["winding_degC"].sides)
    assert "I_ph [degC]" not in found["winding_degC"].sides


def test_a_column_that_is_read_already_is_not_proposed(tmp_path):
    columns = {"time_s": TIME_S, "phase_current_A": CURRENT, "T_winding [degC]": WINDING}
    (ambient,) = [each for each in choices([survey(named(tmp_path, columns))])
                  if each.channel == "ambient_degC"]  # fmt: skip
    assert not ambient.is_proposed
    assert list(ambient.sides) == ["none", "T_winding [degC]"]


def test_what_is_chosen_stands_in_the_draft(surveys):
    chosen = {"winding_degC": "Probe 8 [degC]", "losses_W": "none", "time_s": "time [s]"}
    text = draft("m", surveys, is_accepted=True, columns=chosen)
    motor = parse_motor(text.encode(), "m")
    assert motor.columns["winding_degC"] == "Probe 8 [degC]"
    assert motor.columns["losses_W"] == "none"
    unchanged = parse_motor(draft("m", surveys, is_accepted=True).encode(), "m")
    assert "losses_W" not in unchanged.columns


OHM = 4.0 * (234.5 + WINDING) / 254.5


@pytest.mark.parametrize(
    "names",
    [("U [V]", "I [A]"), ("coil voltage", "current"), ("Uw", "Iw"), ("U_dc [V]", "I_dc [A]")],
)
@pytest.mark.parametrize("amperes", [ZERO + 1.5, CURRENT / 60.0, 10.0 / OHM])
def test_voltage_over_current_that_warms_is_that_of_a_winding(tmp_path, names, amperes):
    """Direct current that is held, switched, or falls as the coil warms at one voltage."""
    columns = dict(zip(names, (OHM * amperes, amperes), strict=True))
    path = named(tmp_path, {"time_s": TIME_S, "T_Raum [degC]": ROOM + 1.0} | columns)
    text = text_of(path)
    (side,) = offered(text, "winding_voltage_V")
    assert "ohm, as copper that warms" in note_on(text, f'winding_voltage_V = "{side}')
    assert "# mechanical_power_W = 0.0" in text  # the power that goes in, less that of a shaft
    motor = parse_motor(draft("coil", [survey(path)], is_accepted=True).encode(), "motor.toml")
    assert motor.phases == 1
    record = read_test(path, motor)
    flows = np.isfinite(record["winding_degC"])
    assert flows.sum() > 200
    assert np.nanmax(np.abs(record["losses_W"] - OHM * amperes**2)) < 0.01
    # by the resistance at the start, where the coil is as cold as the room, whose sensor has 0.2 K
    np.testing.assert_allclose(record["winding_degC"][flows], WINDING[flows], atol=0.4)


@pytest.mark.parametrize(
    ("beside", "is_told"),
    [({}, False), ({"T_Raum [degC]": ROOM}, True),
     ({"T_Raum [degC]": ROOM, "housing [degC]": ROOM + 8.0}, False)],
    ids=["no room", "cold", "warm housing"],
)  # fmt: skip
def test_the_cold_resistance_is_that_of_the_start_where_the_machine_is_cold(
    tmp_path, beside, is_told
):
    columns = {"time_s": TIME_S, "U [V]": OHM * 1.5, "I [A]": ZERO + 1.5, **beside}
    accepted = draft("coil", [survey(named(tmp_path, columns))], is_accepted=True)
    assert ("phase_resistance_ohm = 4.0" in accepted) == is_told
    assert ("# phase_resistance_ohm =" in accepted) != is_told


SUPPLY = ZERO + 48.0
DRAWN = (4.0 + 3.0 * LOAD) * (1.0 + 0.02 * np.sin(TIME_S))


@pytest.mark.parametrize(
    "columns",
    [
        {"U [V]": SUPPLY, "I [A]": DRAWN},
        {"U [V]": SUPPLY - 0.2 * DRAWN, "I [A]": DRAWN[::-1]},
        {"U [V]": OHM * 1.5, "I [A]": ZERO + 1.5, "speed [rpm]": ZERO + 900.0},
    ],
    ids=["supply", "sagging supply", "turning"],
)
def test_what_a_supply_holds_is_no_voltage_of_a_winding(tmp_path, columns):
    path = named(tmp_path, {"time_s": TIME_S, "T_Raum [degC]": ROOM} | columns)
    assert offered(text_of(path), "winding_voltage_V") == []


def test_beside_a_sensor_the_voltage_of_a_winding_tells_its_losses(tmp_path):
    columns = {"time_s": TIME_S, "T_Raum [degC]": ROOM, "T1 [degC]": WINDING}
    path = named(tmp_path, columns | {"U [V]": OHM * 1.5, "I [A]": ZERO + 1.5})
    text = text_of(path)
    assert offered(text, "winding_degC") == ["T1 [degC]"]
    assert "losses_W is winding_voltage_V·phase_current_A" in text
