"""What benches send is answered: `init --accept` and `check` on files whose truth is known."""

import json
import math
import re
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from functools import cache

import numpy as np
import pytest

from heatrun import cli
from heatrun.motor.file import load_motor
from heatrun.readers.joined import read_test

START = datetime(2025, 6, 17, 7, 41, 5)
RESISTANCE_OHM = 0.42


@cache
def heat_run(number: int) -> dict[str, np.ndarray]:
    """A small drive on a bench, by Euler steps: steps of load and a rest at the end.

    Args:
        number: Chooses loads, speed and room.

    Returns:
        Quantity to values in SI units and degC, shape (360,).
    """
    rng = np.random.default_rng(700 + number)
    time_s, step_s = np.arange(360) * 12.0, 12.0
    levels = np.array([0.0, *rng.permutation([0.45, 0.95, 0.7, 1.05]), 0.0])
    load = levels[np.searchsorted([120.0, 1100.0, 1900.0, 2700.0, 3600.0], time_s, side="right")]
    room = 20.0 + number % 5 + 0.3 * np.sin(time_s / 900.0) + rng.normal(0.0, 0.03, 360)
    current = (9.0 + number % 4) * load
    speed = np.where(load > 0.0, 1400.0 + 150.0 * (number % 4) - 40.0 * load, 0.0)
    copper, winding, housing = np.empty(360), np.empty(360), np.empty(360)
    T_w = T_s = room[0]
    for i in range(360):
        winding[i], housing[i] = T_w, T_s
        copper[i] = 3.0 * current[i] ** 2 * RESISTANCE_OHM * (234.5 + T_w) / 259.5
        flow = (T_w - T_s) / 0.11
        T_w += step_s * (copper[i] - flow) / 700.0
        T_s += step_s * (flow + 30.0 * (load[i] > 0.0) - (T_s - room[i]) / 0.19) / 6400.0
    losses = copper + 30.0 * (load > 0.0)
    ohms = RESISTANCE_OHM * (234.5 + winding) / 259.5
    torque = 14.0 * load
    shaft = torque * speed * math.pi / 30.0
    return {
        "time": time_s, "current": current, "losses": losses, "room": room, "speed": speed,
        "winding": winding + rng.normal(0.0, 0.03, 360), "housing": housing, "torque": torque,
        "input": shaft + losses, "shaft": shaft, "bearing": room + 0.4 * (housing - room),
        "voltage": 48.0 - 1.5 * load, "dc current": (shaft + losses) / (48.0 - 1.5 * load),
        "q": math.sqrt(2.0) * current, "d": np.full(360, -0.1) * load, "mosfet": room + 12.0 * load,
        "number": np.arange(1.0, 361.0), "zero": np.zeros(360), "resistance": ohms,
        "duty": 0.8 * load, "gear": room + 20.0,
    }  # fmt: skip


@dataclass(frozen=True)
class Sent:
    """A file of a bench with what each column is."""

    name: str  # Whose it is.
    # Header to (quantity of `heat_run`, factor); "clock" is a time of day.
    columns: dict[str, tuple[str, float]]
    truth: dict[str, str]  # Channel to the header that it must be read from.
    delimiter: str = ","  # Between cells.
    codec: str = "utf-8"  # Encoding.
    below: tuple[str, ...] = ()  # A row of units.
    comma: bool = False  # Numbers have a decimal comma.
    before: tuple[str, ...] = field(default=())

    def written(self, folder, number):
        """Write it and return where it lies."""
        run, cells = heat_run(number), []
        for quantity, factor in self.columns.values():
            if quantity in ("clock", "date"):
                form = "%H:%M:%S" if quantity == "clock" else "%Y-%m-%d %H:%M:%S"
                cells.append([(START + timedelta(seconds=s)).strftime(form) for s in run["time"]])
            else:
                texts = [f"{value * factor:.5g}" for value in run[quantity]]
                cells.append([text.replace(".", ",") for text in texts] if self.comma else texts)
        rows = [
            list(self.columns),
            *([list(self.below)] if self.below else []),
            *zip(*cells, strict=True),
        ]
        lines = [*self.before, *(self.delimiter.join(row) for row in rows)]
        path = folder / "sent.csv"
        path.write_bytes("\r\n".join(lines).encode(self.codec))
        return path


def sent(name, heads, quantities, channels, delimiter=",", codec="utf-8", below="", **more):
    """Return what a bench sends: `|` between headers and units, blanks between the others."""
    names = heads.split("|")
    pairs = [one.partition("*") for one in quantities.split("|")]
    columns = {head: (quantity, float(factor or 1.0))
               for head, (quantity, _, factor) in zip(names, pairs, strict=True)}  # fmt: skip
    said = zip(channels.split(), names, strict=True)
    truth = {channel: head for channel, head in said if channel != "-"}
    units = tuple(below.split("|")) if below else ()
    return Sent(name, columns, truth, delimiter, codec, units, **more)


DRIVE = "time_s winding_degC ambient_degC phase_current_A electrical_power_W torque_Nm speed_rpm"
GIVEN = "winding|room|current|input|torque|speed"
GUESSED = (
    sent("English", "Elapsed [s]|Stator winding temp [°C]|Room temp [°C]|Motor current [A]|"
         "Losses [W]|Bearing DE [°C]", "time|winding|room|current|losses|bearing",
         "time_s winding_degC ambient_degC phase_current_A losses_W bearing_degC"),
    sent("English, power in", "Time|End winding (°C)|Ambient air (°C)|RMS phase current (A)|"
         "Input power (W)|Shaft torque (Nm)|Shaft speed (rpm)", f"clock|{GIVEN}", DRIVE),
    sent("German, cp1252", "Uhrzeit|Wickelkopf AS|Hallenluft|Motorstrom|Aufnahmeleistung|"
         "Drehmoment|Motordrehzahl", "clock|winding|room|current|input*0.001|torque|speed",
         DRIVE, ";", "cp1252", "|°C|°C|A|kW|Nm|1/min", comma=True),
    sent("German, losses", "Zeit [s]|Strangstrom eff. [A]|Gesamtverluste [W]|Kupfertemp. [°C]|"
         "Lufttemperatur [°C]|Lagertemperatur [°C]", "time|current|losses|winding|room|bearing",
         "time_s phase_current_A losses_W winding_degC ambient_degC bearing_degC", ";", comma=True),
    sent("Italian", "Ora|Temp. avvolgimento [°C]|Temp. aria [°C]|Corrente motore [A]|"
         "Potenza assorbita [kW]|Coppia [Nm]|Giri [1/min]",
         "clock|winding|room|current|input*0.001|torque|speed", DRIVE, ";", "cp1252", comma=True),
    sent("French", "Heure|Température bobinage [°C]|Température de l'air [°C]|Courant moteur [A]|"
         "Puissance absorbée [W]|Couple [N.m]|Vitesse [tr/min]", f"clock|{GIVEN}", DRIVE, ";",
         "cp1252", comma=True),
    sent("Spanish", "Hora|Temperatura bobinado (°C)|Temperatura del aire (°C)|Corriente motor (A)|"
         "Potencia absorbida (kW)|Par (Nm)|Velocidad (rpm)",
         "clock|winding|room|current|input*0.001|torque|speed", DRIVE, ";"),
    sent("Japanese", "時刻|巻線温度[℃]|外気温[℃]|モータ電流[A]|入力電力[W]|トルク[Nm]|"
         "回転速度[rpm]", f"clock|{GIVEN}", DRIVE, ",", "cp932"),
    sent("Chinese", "时间|绕组温度(℃)|环境温度(℃)|定子电流(A)|输入功率(kW)|转矩(Nm)|转速(rpm)",
         "clock|winding|room|current|input*0.001|torque|speed", DRIVE, ",", "gb18030"),
    sent("VESC Tool", "ms_today|input_voltage|temp_mos_max|temp_motor|current_motor|current_in|"
         "d_axis_current|q_axis_current|erpm|duty_cycle|amp_hours_used|fault_code",
         "time*1000|voltage|mosfet|winding|q|dc current|d|q|speed*7|duty|number*0.01|zero",
         "time_s dc_voltage_V controller_degC winding_degC - dc_current_A i_d_A i_q_A - - - -",
         ";"),
    sent("VESC app", "Time (s)|Volts|Battery Current|Motor Current|MOSFET Temp|Motor Temp|Duty|RPM",
         "time|voltage|dc current|current|mosfet|winding|duty|speed",
         "time_s - dc_current_A phase_current_A controller_degC winding_degC - speed_rpm"),
    sent("ODrive", "t|axis1.motor.motor_thermistor.temperature|axis1.motor.fet_thermistor."
         "temperature|axis1.motor.current_control.Iq_measured|axis1.motor.current_control."
         "Id_measured|axis1.motor.current_control.Iq_setpoint|vbus_voltage|ibus",
         "time|winding|mosfet|q|d|q*1.02|voltage|dc current",
         "time_s winding_degC controller_degC i_q_A i_d_A - dc_voltage_V dc_current_A"),
    sent("moteus", "timestamp|mode|velocity|torque|q_current|d_current|motor_temperature|voltage|"
         "temperature|fault", "time|number|speed*0.016667|torque|q|d|winding|voltage|mosfet|zero",
         "time_s - speed_rpm torque_Nm i_q_A i_d_A winding_degC dc_voltage_V controller_degC -"),
    sent("Cycle Analyst", "s|V|A|RPM|Deg|Nm|Throttle",
         "time|voltage|dc current|speed|winding|torque|duty",
         "time_s dc_voltage_V dc_current_A speed_rpm winding_degC torque_Nm -", "\t"),
    sent("SCADA of a turbine", "# Date and time|Stator temperature 1 (°C)|Nacelle ambient "
         "temperature (°C)|Front bearing temperature (°C)|Gear oil temperature (°C)|"
         "Current L1 / U (A)|Generator RPM (RPM)", "date|winding|room|bearing|gear|current|speed",
         "time_s winding_degC ambient_degC bearing_degC - phase_current_A speed_rpm"),
    sent("SCADA of a plant", "TimeStamp|P4711.MOTOR.WDG_TEMP_U|P4711.MOTOR.AMB_TEMP|"
         "P4711.MOTOR.CURRENT|P4711.MOTOR.BRG_DE_TEMP|P4711.MOTOR.SPEED",
         "date|winding|room|current|bearing|speed",
         "time_s winding_degC ambient_degC phase_current_A bearing_degC speed_rpm", ";"),
    sent("HIOKI PW6001", "Date|Irms1[A]|P123[W]|Tq1[Nm]|Spd1[r/min]|Pm1[W]|CH1_Coil[degC]|"
         "CH2_Room[degC]",
         "date|current|input|torque|speed|shaft|winding|room",
         "time_s phase_current_A electrical_power_W torque_Nm speed_rpm mechanical_power_W "
         "winding_degC ambient_degC"),
    sent("Yokogawa WT", "Store No.|Time|Urms-Element1|Irms-Element1|P-SigmaA|Speed-Motor1|"
         "Torque-Motor1|Winding|Ambient",
         "number|clock|voltage|current|input|speed|torque|winding|room",
         "- time_s - phase_current_A electrical_power_W speed_rpm torque_Nm winding_degC "
         "ambient_degC", ",", "utf-8", "|hh:mm:ss|V|A|W|rpm|Nm|C|C"),
    sent("dSPACE", "time|Model Root/Bench/T_wdg|Model Root/Bench/T_amb|Model Root/Inverter/I_rms|"
         "Model Root/Bench/P_loss|Model Root/Inverter/T_heatsink",
         "time|winding|room|current|losses|mosfet",
         "time_s winding_degC ambient_degC phase_current_A losses_W controller_degC", ";"),
    sent("INCA", "time|EM_tWdg\\XCP:1|Env_tAmb\\XCP:1|EM_iPhRms\\XCP:1|EM_pLoss\\XCP:1|"
         "EM_nRot\\XCP:1", "time|winding|room|current|losses*0.001|speed",
         "time_s winding_degC ambient_degC phase_current_A losses_W speed_rpm", ";", "utf-8",
         "s|°C|°C|A|kW|rpm"),
)  # fmt: skip


def answered(capsys, *words):
    """Return the exit code and the JSON of a command."""
    capsys.readouterr()
    code = cli.main([*map(str, words), "--json"])
    return code, json.loads(capsys.readouterr().out)


def read_channels(record):
    return {one.channel: one.column for one in record.mapping if one.column}


@pytest.mark.parametrize("number", range(len(GUESSED)), ids=[one.name for one in GUESSED])
def test_columns_of_other_makes_and_languages_are_guessed(tmp_path, capsys, number):
    file, motor = GUESSED[number], tmp_path / "motor.toml"
    path = file.written(tmp_path, number)
    code, _ = answered(capsys, "init", path, "--accept", "--out", motor)
    assert code == 0
    text = re.sub(
        "# (phase_resistance_ohm = ).*", rf"\g<1>{RESISTANCE_OHM}", motor.read_text("utf-8")
    )
    motor.write_text(text, "utf-8")
    found = read_channels(read_test(str(path), load_motor(motor)))
    assert found.items() <= file.truth.items()  # nothing is taken for what it is not
    for channel in file.truth.keys() - found.keys():  # not needed: offered
        assert f'# {channel} = "{file.truth[channel]}' in text
    needed = {"time_s", "winding_degC", "ambient_degC", "losses_W", "electrical_power_W"}
    assert needed & file.truth.keys() <= found.keys()


MOTOR = """[motor]
name = "bench"
[winding]
phase_resistance_ohm = 0.42
[columns]
{columns}
[constants]
{constants}
"""


def files_of(folder, number, columns, lines, constants=""):
    """Write a motor file and a table: heading to quantity, channel to right-hand side."""
    made = Sent("", {head: (quantity, 1.0) for head, quantity in columns.items()}, {})
    motor = folder / "motor.toml"
    mapped = "\n".join(f'{channel} = "{line}"' for channel, line in lines.items())
    motor.write_text(MOTOR.format(columns=mapped, constants=constants), "utf-8")
    return motor, made.written(folder, number)


HEAT = {"t [s]": "time", "T_w [°C]": "winding", "T_a [°C]": "room"}
HEAT_LINES = {"winding_degC": "T_w [°C]", "ambient_degC": "T_a [°C]", "time_s": "t [s]"}


@pytest.mark.parametrize("name", ["R_w [Ω]", "Wicklungswiderstand [mΩ]", "巻線抵抗[Ω]",
                                  "Resistenza avvolgimento [Ω]", "Phase resistance (mOhm)",
                                  "绕组电阻(mΩ)"])  # fmt: skip
def test_a_resistance_is_guessed_for_the_winding(tmp_path, capsys, name):
    factor = 1e3 if "m" in name[-5:] else 1.0
    made = Sent("", {"t [s]": ("time", 1.0), "Room [°C]": ("room", 1.0), "I [A]": ("current", 1.0),
                     "Losses [W]": ("losses", 1.0), name: ("resistance", factor)}, {})  # fmt: skip
    path, motor = made.written(tmp_path, 50), tmp_path / "motor.toml"
    answered(capsys, "init", path, "--accept", "--out", motor)
    text = motor.read_text("utf-8").replace(
        "# phase_resistance_ohm = ", "phase_resistance_ohm = 0.42#"
    )
    motor.write_text(text, "utf-8")
    record = read_test(str(path), load_motor(motor))
    assert read_channels(record)["winding_resistance_ohm"] == name
    np.testing.assert_allclose(record["winding_degC"], heat_run(50)["winding"], atol=0.13)


HEAT_ALONE = {
    # name: (columns, lines, constants)
    "a heated block": ({"P [W]": "losses"}, {"losses_W": "P"}, ""),
    "a motor of which the current was not recorded": (
        {"P1 [W]": "input", "M [Nm]": "torque", "n [rpm]": "speed"},
        {"electrical_power_W": "P1", "torque_Nm": "M", "speed_rpm": "n"}, ""),
    "one room, current of zero": ({"P [W]": "losses"}, {"losses_W": "P", "ambient_degC": "none"},
                                  "ambient_degC = 22.0\nphase_current_A = 0"),
}  # fmt: skip


@pytest.mark.parametrize("member", HEAT_ALONE)
def test_the_first_order_needs_no_current(tmp_path, capsys, member):
    columns, lines, constants = HEAT_ALONE[member]
    number = 60 + list(HEAT_ALONE).index(member)
    motor, path = files_of(tmp_path, number, HEAT | columns, HEAT_LINES | lines, constants)
    text = motor.read_text("utf-8").replace("phase_resistance_ohm = 0.42\n", "")
    motor.write_text(text, "utf-8")
    code, said = answered(capsys, "check", motor, path, "--model", "first")
    assert code == 0
    told = {one["id"] for one in said["findings"] if one["severity"] != "note"}
    assert not told & {"missing_channel", "single_step", "no_resistance"}
    assert said["suitability"][0]["will_do"] is True


@pytest.mark.parametrize("loaded_s", [0.0, 1500.0, 7200.0])
def test_time_constants_are_those_of_the_part_without_load(tmp_path, capsys, loaded_s):
    time_s = np.arange(0.0, 7200.0, 10.0)
    later_s = np.maximum(time_s - loaded_s, 0.0)
    fast_K, slow_K = (rise * np.exp(-later_s / tau) for rise, tau in ((10.0, 40.0), (60.0, 1000.0)))
    before_K = 40.0 * np.exp(-time_s / 3000.0) - 40.0 * np.exp(-min(loaded_s, 7200.0) / 3000.0)
    winding = 21.0 + fast_K + slow_K + np.where(time_s < loaded_s, before_K, 0.0)
    is_on = time_s < loaded_s
    rows = zip(time_s, winding, 20.0 * is_on, 60.0 * is_on, strict=True)
    lines = HEAT_LINES | {"phase_current_A": "I [A]", "losses_W": "P [W]"}
    lines.pop("ambient_degC", None)
    motor, path = files_of(tmp_path, 0, HEAT, lines, "ambient_degC = 21")
    text = "\n".join(",".join(f"{value:.2f}" for value in row) for row in rows)
    path.write_text(f"t [s],T_w [°C],I [A],P [W]\n{text}", "utf-8")
    _, said = answered(capsys, "check", motor, path)
    (told,) = [one["values"] for one in said["findings"] if one["id"] == "no_heating"]
    found = [told[name] for name in ("tau_fast_s", "tau_slow_s") if name in told]
    np.testing.assert_allclose(found, [40.0, 1000.0] if loaded_s < 7200.0 else [], rtol=0.05)


COOLING = {
    # name: (rises [K] and time constants [s], step [s], digits, [columns] and [constants])
    "a motor, zeros recorded": (((30.0, 60.0), (55.0, 1200.0)), 10.0, 2, True),
    "temperatures alone": (((12.0, 90.0), (70.0, 2400.0)), 15.0, 2, False),
    "a drone's motor": (((25.0, 8.0), (20.0, 150.0)), 1.0, 2, False),
    "one body": (((60.0, 700.0),), 10.0, 2, True),
    "a transformer in oil": (((14.0, 400.0), (38.0, 9000.0)), 120.0, 2, False),
    "a logger of tenths": (((25.0, 75.0), (60.0, 900.0)), 10.0, 1, True),
    "cut before it has settled": (((20.0, 50.0), (60.0, 1500.0)), 10.0, 3, False),
}  # fmt: skip


@pytest.mark.parametrize("member", COOLING)
def test_a_cool_down_is_told_its_time_constants(tmp_path, capsys, member):
    terms, step_s, digits, has_zeros = COOLING[member]
    lasts = (2.0 if member.startswith("cut") else 3.5) * terms[-1][1]
    time_s = np.arange(0.0, lasts, step_s)
    room = 21.0 + 0.1 * np.sin(time_s / lasts)
    winding = room + sum(rise * np.exp(-time_s / tau) for rise, tau in terms)
    table = {"t [s]": time_s, "T_w [°C]": winding, "T_a [°C]": room}
    lines = dict(HEAT_LINES)
    if has_zeros:
        table |= {"I [A]": 0.0 * time_s, "P [W]": 0.0 * time_s}
        lines |= {"phase_current_A": "I [A]", "losses_W": "P [W]"}
    motor, path = files_of(tmp_path, 0, HEAT, lines,
                           "" if has_zeros else "phase_current_A = 0\nlosses_W = 0")  # fmt: skip
    rows = zip(*([f"{v:.{digits}f}" for v in values] for values in table.values()), strict=True)
    path.write_text("\n".join(",".join(row) for row in (table, *rows)), "utf-8")
    code, said = answered(capsys, "check", motor, path)
    assert code == 0
    (told,) = [one["values"] for one in said["findings"] if one["id"] == "no_heating"]
    found = [told[name] for name in ("tau_fast_s", "tau_slow_s") if name in told]
    np.testing.assert_allclose(found, [tau for _, tau in terms], rtol=0.05)
    assert "time constants only" in said["suitability"][0]["sentence"]
