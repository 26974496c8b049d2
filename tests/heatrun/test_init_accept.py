"""What names `init` knows, `init --accept`, and `calibrate` without a motor file."""

import io
import math

import numpy as np
import pytest
import scipy.io
from drafted import (
    CURRENT,
    HOUSING,
    LOAD,
    LOSSES,
    ROOM,
    TIME_S,
    WINDING,
    named,
    note_on,
    offered,
    text_of,
)

from heatrun import cli
from heatrun.commands.init import motor_of_tests
from heatrun.errors import InputError
from heatrun.init.draft import MOST_LINES, draft
from heatrun.init.gaps import gaps
from heatrun.init.survey import survey
from heatrun.motor.file import load_motor, parse_motor
from heatrun.readers.joined import read_test
from heatrun.readers.likely_names import LIKELY, likely_channels

SPEED = 1500.0 - 100.0 * LOAD
TORQUE = 4.0 + 6.0 * LOAD
SHAFT = TORQUE * SPEED * math.pi / 30.0
INPUT = SHAFT + LOSSES + 60.0
NAMES = {"t [s]": TIME_S, "Torque [Nm]": TORQUE, "Speed [rpm]": SPEED}


def warming(time_constant_s: float, rise_K: float) -> np.ndarray:
    """A body that the load heats, from 22 degC."""
    level, course = 0.0, []
    for heat in (CURRENT / 100.0) ** 2:
        level += 10.0 * (rise_K * heat - level) / time_constant_s
        course.append(22.0 + level)
    return np.array(course)


COIL, CASE = warming(400.0, 80.0), warming(3000.0, 60.0)


def accepted(path) -> str:
    text = draft("m", [survey(path)], is_accepted=True)
    parse_motor(text.encode(), "motor.toml")
    return text


def live(text: str) -> dict[str, str]:
    """The right-hand sides of the lines that hold, by channel."""
    return dict(parse_motor(text.encode(), "motor.toml").columns)


def test_the_best_candidates_hold_and_are_marked(tmp_path):
    columns = {"Zeit [s]": TIME_S, "I_Mot [A]": CURRENT, "P_V [W]": LOSSES, "K1 [°C]": CASE,
               "K2 [°C]": COIL, "K3 [°C]": ROOM}  # fmt: skip
    text = accepted(named(tmp_path, columns))
    assert live(text) == {
        "phase_current_A": "I_Mot [A]",
        "losses_W": "P_V [W]",
        "ambient_degC": "K3 [°C]",
        "winding_degC": "K2 [°C]",
    }
    held = [line for line in text.split("\n") if line.startswith(tuple(live(text)))]
    assert len(held) == 4
    assert all("  # please check: " in line for line in held)
    assert "warms with 'I_Mot [A]' and cools when it falls" in text
    # what nobody can know stays open
    assert "# Missing:\n# 1. [winding] phase_resistance_ohm" in text
    assert "2. [" not in text


@pytest.mark.parametrize(
    ("name", "other"), [("Time [s]", TIME_S + 90.0), ("Time_2 [s]", 0.5 * TIME_S)]
)
def test_of_two_clocks_none_is_chosen_in_silence(tmp_path, name, other):
    pairs = ("Time [s]" if name == "Time [s]" else "Time_1 [s]", "Winding [°C]", name, "Irms [A]",
             "Losses [W]", "Ambient [°C]")  # fmt: skip
    rows = zip(TIME_S, COIL, other, CURRENT, LOSSES, ROOM, strict=True)
    path = tmp_path / "xy.csv"
    lines = [";".join(pairs), *(";".join(f"{value:.5g}" for value in row) for row in rows)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    assert "time_s" not in live(accepted(path))
    (gap,) = [one for one in gaps([survey(path)]) if one.channel == "time_s"]
    assert not gap.is_answered
    assert "xy.csv has two clocks that differ, 'Time" in gap.sentence
    assert "TEMPERATURES.csv+DRIVE.csv" in gap.sentence


def test_a_date_beside_the_seconds_is_the_same_clock(tmp_path):
    columns = {"Timestamp A [s]": TIME_S + 86400.0, "Elapsed time B [min]": TIME_S / 60.0,
               "Irms [A]": CURRENT}  # fmt: skip
    path = named(tmp_path, columns)
    assert "time_s" in live(accepted(path))
    assert not any("two clocks" in one.sentence for one in gaps([survey(path)]))


def test_a_draft_has_at_most_forty_lines(tmp_path):
    """More columns than lines, and a candidate among them for each channel."""
    many = {f"Sensor {n} [°C]": HOUSING + n for n in range(20)}
    many |= {f"I{n} [A]": CURRENT for n in range(20)} | {f"Aux {n}": ROOM for n in range(20)}
    surveyed = [survey(named(tmp_path, many))]
    for is_accepted in (False, True):
        text = draft("m", surveyed, is_accepted=is_accepted)
        assert text.count("\n") <= MOST_LINES == 40
        for channel in ("winding_degC", "ambient_degC", "phase_current_A"):
            assert f"{channel} = " in text
        assert "more columns: heatrun check lists them" in text


@pytest.mark.parametrize("name", ["P [W]", "P_V [W]", "Power [W]", "Verlustleistung [W]", "P1 [W]"])
def test_a_little_more_than_torque_times_omega_is_the_input(tmp_path, name):
    path = named(tmp_path, NAMES | {name: INPUT, "I [A]": CURRENT})
    text = accepted(path)
    assert live(text)["electrical_power_W"] == name
    assert "losses_W" not in live(text)
    assert "the input, not the losses" in text
    motor = parse_motor(
        text.replace("[constants]", "[constants]\nwinding_degC = 0", 0).encode(), "m"
    )
    np.testing.assert_allclose(read_test(path, motor)["losses_W"], LOSSES + 60.0, atol=0.5)


@pytest.mark.parametrize("power", ["P123[W]", "PSigma [W]", "Psum [W]", "Moc pobrana [W]", "P [W]"])
def test_the_power_beside_three_currents_is_the_input(tmp_path, power):
    columns = {"t [s]": TIME_S, power: INPUT, "T_Mot [°C]": COIL, "T_a [°C]": ROOM}
    columns |= {f"Irms{n}[A]": (1.0 + 0.002 * n) * CURRENT for n in (1, 2, 3)}
    text = accepted(named(tmp_path, columns))
    assert "losses_W" not in live(text)
    assert f"electrical_power_W = {power}" in text.replace('"', "")
    assert live(text)["phase_current_A"] == "mean(Irms1, Irms2, Irms3)"
    assert "# mechanical_power_W =" in text


@pytest.mark.parametrize(
    ("goes_in", "comes_out"),
    [("P in [kW]", "P out [kW]"), ("Puissance absorbée [W]", "Puissance utile [W]"),
     ("Potenza assorbita [W]", "Potenza resa [W]"), ("P_zu [W]", "Nutzleistung [W]"),
     ("Potencia absorbida [W]", "Potencia útil [W]"), ("Moc pobrana [W]", "Moc oddana [W]")],
)  # fmt: skip
def test_what_a_motor_delivers_is_the_power_at_the_shaft(tmp_path, goes_in, comes_out):
    columns = {"t [s]": TIME_S, goes_in: INPUT, comes_out: SHAFT, "T_Mot [°C]": COIL}
    columns |= {f"Irms{n}[A]": (1.0 + 0.002 * n) * CURRENT for n in (1, 2, 3)}
    path = named(tmp_path, columns)
    read = {one.channel: one.column for one in survey(path).recognised}
    assert (read | live(accepted(path)))["mechanical_power_W"] == comes_out


@pytest.mark.parametrize(
    ("name", "said"),
    [("Kanal 7 [W]", "Perhaps it is 'Kanal 7 [W]'. Write 0 only where the rotor stands."),
     ("SHAFT POWER (HP)", "Column 'SHAFT POWER (HP)' would be it, but mechanical_power_W is not")],
)  # fmt: skip
def test_a_power_that_nothing_claims_is_named_before_a_rotor_that_stands(tmp_path, name, said):
    columns = {"t [s]": TIME_S, "P_in [W]": INPUT, name: SHAFT, "T_Mot [°C]": COIL,
               "I_rms [A]": CURRENT, "T_a [°C]": ROOM}  # fmt: skip
    path = named(tmp_path, columns)
    (gap,) = [one for one in gaps([survey(path)]) if one.channel == "mechanical_power_W"]
    assert said in gap.sentence
    assert "mechanical_power_W" not in live(accepted(path))


@pytest.mark.parametrize("names", ["P-{} [W]", "P{} [kW]"])
def test_three_wattmeters_beside_three_currents_are_summed(tmp_path, names):
    columns = NAMES | {"T_Mot [°C]": COIL, "T_a [°C]": ROOM}
    share = 1e-3 if "kW" in names else 1.0
    columns |= {names.format(n): share * INPUT * (0.32 + 0.01 * n) for n in (1, 2)}
    columns |= {names.format(3): share * INPUT * 0.35}
    columns |= {f"Irms-{n} [A]": (1.0 + 0.002 * n) * CURRENT for n in (1, 2, 3)}
    path = named(tmp_path, columns)
    text = accepted(path)
    label = names.partition(" ")[0]
    summed = f"sum({', '.join(label.format(n) for n in (1, 2, 3))})"
    assert live(text)["electrical_power_W"] == summed
    record = read_test(path, parse_motor(text.encode(), "motor.toml"))
    np.testing.assert_allclose(record["electrical_power_W"], 1.02 * INPUT, rtol=1e-3)


def test_three_powers_in_a_row_are_no_phases(tmp_path):
    """Source, inverter and shaft: close to each other, and of one current."""
    columns = NAMES | {f"P{n} [W]": INPUT * (1.05 - 0.02 * n) for n in (1, 2, 3)}
    path = named(tmp_path, columns | {"Irms [A]": CURRENT, "T_Mot [°C]": COIL, "T_a [°C]": ROOM})
    assert "sum(" not in accepted(path)


@pytest.mark.parametrize("machines", ["M1_{} M2_{}", "Motor A {}/Motor B {}", "EM1.{} EM2.{}",
                                      "{}_M1 {}_M2"])  # fmt: skip
def test_of_two_machines_in_a_file_one_is_drafted(tmp_path, machines, capsys):
    """The second one is warmer and draws more, by which its columns would go first."""
    first, second = machines.split("/" if "/" in machines else " ")
    columns = {"t [s]": TIME_S, "T_amb [°C]": ROOM}
    for place, name in enumerate((second, first)):
        columns |= {name.format("Twdg") + " [°C]": COIL + 9.0 - 9.0 * place,
                    name.format("Irms") + " [A]": CURRENT * (1.1 - 0.1 * place),
                    name.format("Ploss") + " [W]": LOSSES}  # fmt: skip
    path = named(tmp_path, columns)
    text = accepted(path)
    assert {channel: live(text).get(channel) for channel in ("winding_degC", "losses_W")} == {
        "winding_degC": first.format("Twdg") + " [°C]",
        "losses_W": first.format("Ploss") + " [W]",
    }
    assert live(text)["phase_current_A"] == first.format("Irms") + " [A]"
    assert "Open: Columns of two machines" in text
    assert cli.main(["init", str(path), "--out", str(tmp_path / "m.toml")]) == 0
    assert "Columns of two machines" in capsys.readouterr().err


def test_two_sensors_of_each_kind_are_no_two_machines(tmp_path):
    columns = {"t [s]": TIME_S, "T_1 [°C]": COIL, "T_2 [°C]": CASE, "I_1 [A]": CURRENT,
               "I_2 [A]": CURRENT, "I_3 [A]": CURRENT}  # fmt: skip
    assert "two machines" not in text_of(named(tmp_path, columns))


def test_a_direct_current_is_no_reason_to_write_that_none_heats(tmp_path):
    columns = {"t [s]": TIME_S, "U_dc [V]": 0.1 * CURRENT, "I_dc [A]": CURRENT, "T_Mot [°C]": COIL,
               "T_a [°C]": ROOM}  # fmt: skip
    asked = str(gaps([survey(named(tmp_path, columns))]))
    assert "Write 0 where no current heats" not in asked
    assert "direct current in 'I_dc [A]' heats the coil itself" in asked
    del columns["I_dc [A]"], columns["U_dc [V]"]
    asked = str(gaps([survey(named(tmp_path, columns))]))
    assert "Write 0 where no current heats" in asked


def test_losses_beside_the_shaft_stay_losses(tmp_path):
    path = named(tmp_path, NAMES | {"P_V [W]": LOSSES + 40.0, "P1 [W]": INPUT, "I [A]": CURRENT})
    assert live(accepted(path))["losses_W"] == "P_V [W]"


def test_what_is_torque_times_omega_is_the_power_at_the_shaft(tmp_path):
    columns = {"t [s]": TIME_S, "P1 [W]": INPUT, "P2 [W]": SHAFT, "M1 [Nm]": TORQUE,
               "n1 [rpm]": SPEED, "I [A]": CURRENT}  # fmt: skip
    text = text_of(named(tmp_path, columns))
    assert offered(text, "electrical_power_W")[0] == "P1 [W]"
    assert "is torque·omega, the power at the shaft" in text


def test_a_voltage_times_a_current_is_electrical_and_the_shaft_is_asked_for(tmp_path):
    columns = {"t [s]": TIME_S, "U [V]": 24.0 + LOAD, "I [A]": CURRENT,
               "P [W]": (24.0 + LOAD) * CURRENT, "T_Mot [°C]": COIL, "T_a [°C]": ROOM}  # fmt: skip
    text = accepted(named(tmp_path, columns))
    assert live(text)["electrical_power_W"] == "P [W]"
    assert "# mechanical_power_W =    # put in the number, such as 0.0" in text


def test_currents_of_d_and_q_go_before_a_motor_current(tmp_path):
    columns = {"ms_today": TIME_S * 1000.0, "current_motor": CURRENT,
               "d_axis_current": CURRENT * 0.0 - 0.2, "q_axis_current": CURRENT,
               "temp_mos_max": CASE, "temp_motor": COIL}  # fmt: skip
    assert live(accepted(named(tmp_path, columns))) == {
        "time_s": "ms_today [ms]",
        "winding_degC": "temp_motor",
        "i_d_A": "d_axis_current",
        "i_q_A": "q_axis_current",
    }


def test_a_q_current_alone_asks_for_that_of_d(tmp_path):
    columns = {"t": TIME_S, "axis0.motor.current_control.Iq_measured": CURRENT,
               "axis0.motor.motor_thermistor.temperature": COIL}  # fmt: skip
    text = accepted(named(tmp_path, columns))
    assert live(text)["i_q_A"] == "axis0.motor.current_control.Iq_measured"
    assert "# i_d_A =    # put in the number, such as 0.0" in text


def test_a_shaft_that_was_recorded_at_rest_asks_for_nothing(tmp_path):
    zero = 0.0 * TIME_S
    columns = {"t [s]": TIME_S, "P_in [W]": INPUT, "Aux M2 [Nm]": zero, "Aux n2 [rpm]": zero}
    said = live(accepted(named(tmp_path, columns)))
    assert (said["torque_Nm"], said["speed_rpm"]) == ("Aux M2 [Nm]", "Aux n2 [rpm]")


def test_what_warms_with_the_load_is_a_temperature_without_name_and_unit(tmp_path):
    noise = np.random.default_rng(4).normal(50.0, 20.0, TIME_S.size)
    columns = {"t [s]": TIME_S, "A1": noise, "A2": COIL, "A3": ROOM, "I_rms [A]": CURRENT}
    text = text_of(named(tmp_path, columns))
    assert offered(text, "winding_degC") == ["A2"]


def heated(steps):
    """A winding of 0.05 ohm: its current by steps [A], the losses and its temperature."""
    current, winding = np.repeat(steps, 90), [22.0]
    for amperes in current[:-1]:
        losses = 3.0 * 0.05 * amperes**2 * (212.5 + winding[-1]) / 234.5
        winding.append(winding[-1] + 10.0 / 2000.0 * (losses - (winding[-1] - 22.0) / 0.3))
    return current, 0.15 * current**2 * (212.5 + np.array(winding)) / 234.5, np.array(winding)


@pytest.mark.parametrize("steps", [(30.0, 45.0, 0.0, 20.0), (0.0, 40.0, 0.0, 40.0)])
def test_what_has_neither_name_nor_unit_is_ranked_by_how_it_runs(tmp_path, steps):
    current, losses, winding = heated(steps)
    room = 22.0 + 0.1 * np.sin(TIME_S / 500.0)
    columns = {"A1": TIME_S, "A2": winding, "A3": room, "A4": current, "A5": losses}
    text = accepted(named(tmp_path, columns))
    assert live(text) == {
        "time_s": "A1",
        "winding_degC": "A2",
        "ambient_degC": "A3",
        "phase_current_A": "A4",
        "losses_W": "A5",
    }
    assert text.count("please check") == 5


def test_a_matrix_without_names_is_ranked_so_too(tmp_path):
    current, losses, winding = heated((30.0, 45.0, 0.0, 20.0))
    rows = np.column_stack((TIME_S, winding, ROOM, current, losses))
    scipy.io.savemat(tmp_path / "log.mat", {"log": rows})
    said = live(accepted(tmp_path / "log.mat"))
    assert said["time_s"] == "log(:,1)"
    assert said["winding_degC"] == "log(:,2)"


@pytest.mark.parametrize(
    ("name", "evenly"),
    [("No.", 1.0 + np.arange(TIME_S.size)), ("x", np.arange(TIME_S.size)),
     ("Ah", 5.0 + 0.01 * TIME_S), ("Index", 10.0 * np.arange(TIME_S.size))],
)  # fmt: skip
def test_what_numbers_the_lines_or_is_a_charge_is_no_time(tmp_path, name, evenly):
    columns = {name: evenly, "T_winding": COIL, "T_amb": ROOM, "I_rms [A]": CURRENT}
    path = named(tmp_path, columns)
    assert "time_s" not in live(accepted(path))
    (gap,) = [one for one in gaps([survey(path)]) if one.channel == "time_s"]
    assert not gap.is_answered
    if name in ("No.", "x"):
        assert "it numbers the lines" in note_on(text_of(path), name)


def test_a_board_that_is_warmer_than_the_winding_began_is_no_room(tmp_path):
    board = 40.0 + 0.5 * np.sin(TIME_S / 500.0)
    columns = {"t [s]": TIME_S, "I_rms [A]": CURRENT, "temperature": board, "T_winding": COIL}
    path = named(tmp_path, columns)
    assert "ambient_degC" not in live(accepted(path))
    assert "16 K warmer than 'T_winding' at its coldest" in note_on(text_of(path), "temperature")


def test_the_registers_of_a_servo_controller_are_known(tmp_path):
    zero = np.zeros(TIME_S.size)
    columns = {"timestamp": TIME_S, "mode": zero + 10.0, "position": zero, "velocity": zero + 25.0,
               "torque": zero + 2.0, "q_current": CURRENT, "d_current": zero,
               "voltage": zero + 24.0, "temperature": zero + 40.0, "fault": zero}  # fmt: skip
    found = survey(named(tmp_path, columns))
    read = {one.channel: (one.column, one.unit) for one in found.recognised}
    assert read["speed_rpm"] == ("velocity", "rev/s")
    assert read["controller_degC"] == ("temperature", "degC")
    assert read["dc_voltage_V"] == ("voltage", "V")
    assert "ambient_degC" not in live(accepted(named(tmp_path, columns)))


def test_a_unit_that_is_guessed_counts_as_assumed(tmp_path):
    """The velocity of moteus is in revolutions per second, which its log does not say."""
    columns = {"t [s]": TIME_S, "servo_stats.velocity": SPEED / 60.0, "torque_Nm": TORQUE,
               "power_W": INPUT, "T_motor [°C]": COIL, "T_amb [°C]": ROOM}  # fmt: skip
    path = named(tmp_path, columns)
    text = accepted(path)
    assert live(text)["speed_rpm"] == "servo_stats.velocity"
    assert "no unit given; read in rpm: check the unit" in note_on(text, "servo_stats.velocity")
    motor = parse_motor(text.encode(), "motor.toml")
    read = {one.channel: one.unit_from for one in read_test(path, motor).mapping}
    assert read["speed_rpm"] == "assumed"


def test_an_axis_and_its_unit_are_a_current_of_the_field(tmp_path):
    columns = {"t [s]": TIME_S, "servo_stats.d_A": 0.0 * CURRENT - 2.0, "servo_stats.q_A": CURRENT,
               "servo_stats.power_W": INPUT, "T_motor [°C]": COIL, "T_amb [°C]": ROOM}  # fmt: skip
    said = live(accepted(named(tmp_path, columns | NAMES)))
    assert (said["i_d_A"], said["i_q_A"]) == ("servo_stats.d_A", "servo_stats.q_A")
    assert "phase_current_A" not in said


def test_the_throttle_of_a_cycle_analyst_is_no_room(tmp_path):
    columns = {"V": 48.0 + LOAD, "A": CURRENT, "Deg": COIL, "RPM": SPEED, "Nm": TORQUE,
               "ThI": 0.82 + 2.0 * LOAD, "ThO": 2.1 + LOAD}  # fmt: skip
    text = text_of(named(tmp_path, columns))
    assert offered(text, "ambient_degC") == []
    assert offered(text, "winding_degC") == ["Deg"]


@pytest.mark.parametrize(
    "name", ["Rotação [rpm]", "Toerental [rpm]", "Varvtal [1/min]", "n1 [rpm]"]
)
def test_the_speed_holds_beside_losses_too(tmp_path, name):
    """The fan of an enclosed motor cools by it."""
    columns = {"t [s]": TIME_S, "Irms [A]": CURRENT, "P_V [W]": LOSSES, "T_cu [°C]": COIL,
               "T_amb [°C]": ROOM, name: SPEED, "n2 set": SPEED}  # fmt: skip
    path = named(tmp_path, columns)
    read = {one.channel: one.column for one in survey(path).recognised}
    assert (read | live(accepted(path)))["speed_rpm"] == name


def test_a_machine_with_coolant_and_no_room_takes_it_as_the_sink(tmp_path):
    columns = {"Zeit [s]": TIME_S, "EM_T_Wickelkopf_max [°C]": COIL + 43.0,
               "KW_T_Vorlauf [°C]": 65.0 + 0.01 * ROOM, "HV_U [V]": 350.0 + LOAD,
               "HV_I [A]": INPUT / 350.0, "EM_n [1/min]": SPEED, "EM_M_ist [Nm]": TORQUE,
               "EM_I_eff [A]": CURRENT}  # fmt: skip
    path = named(tmp_path, columns)
    assert [gap.channel for gap in gaps([survey(path)]) if not gap.is_answered] == [""]
    motor = parse_motor(accepted(path).encode(), "motor.toml")
    assert motor.sink == "coolant"
    assert motor.columns["coolant_degC"] == "KW_T_Vorlauf [°C]"
    assert motor.columns["winding_degC"] == "EM_T_Wickelkopf_max [°C]"
    record = read_test(path, motor)
    assert {"losses_W", "phase_current_A"} <= record.channels.keys()
    assert 'sink = "coolant"' not in accepted(named(tmp_path, columns | {"T_amb [°C]": ROOM}))


def test_a_voltage_over_a_current_is_the_resistance_of_the_winding(tmp_path):
    ohm = 0.1 * (234.5 + WINDING) / 256.5
    columns = {"t [s]": TIME_S, "Resistance": ohm, "T_room [degC]": ROOM}
    columns |= {"I_dc [A]": 30.0 + 0.0 * ohm, "U_dc [V]": 30.0 * ohm}
    assert offered(text_of(named(tmp_path, columns)), "winding_degC") == ["Resistance [ohm]"]


MISSING = {"Zeit [s]": TIME_S, "I_Mot [A]": CURRENT, "P_V [W]": LOSSES, "Temp_Mot [°C]": COIL}


def test_calibrate_without_a_motor_file_says_which_numbers_are_missing(
    tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.stdin", io.StringIO())
    named(tmp_path, MISSING)
    assert cli.main(["calibrate", "test.csv", "--quick"]) == 1
    said = capsys.readouterr().err
    assert "a number for phase_resistance_ohm, ambient_degC" in said
    assert "heatrun calibrate motor.toml test.csv" in said
    assert load_motor("motor.toml").columns["winding_degC"] == "Temp_Mot [°C]"
    # another call does not write over it
    assert cli.main(["calibrate", "test.csv", "--quick", "--holdout", "other.csv"]) == 1
    said = capsys.readouterr().err
    assert "There is a motor file already" in said
    assert "heatrun calibrate motor.toml test.csv --quick --holdout other.csv" in said


def test_calibrate_without_a_motor_file_asks_at_a_terminal(tmp_path, monkeypatch, capsys):
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.stdin", Terminal("six\n-1\n0,0062\n21.5\n"))
    path = named(tmp_path, MISSING)
    motor = load_motor(motor_of_tests([path], "heatrun calibrate test.csv"))
    assert (motor.phase_resistance_ohm, motor.constants) == (0.0062, {"ambient_degC": 21.5})
    said = capsys.readouterr().err
    assert "Expected a number above 0, got 'six'" in said
    assert "Expected a number above 0, got '-1'" in said
    assert "# Missing:" not in (tmp_path / "motor.toml").read_text(encoding="utf-8")


def test_one_node_is_asked_neither_for_a_current_nor_for_a_resistance(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    columns = {"t [s]": TIME_S, "P_V [W]": LOSSES, "T_winding": COIL, "T_amb [°C]": ROOM}
    path = named(tmp_path, columns)
    with pytest.raises(InputError, match="phase_resistance_ohm"):
        motor_of_tests([path], "heatrun calibrate test.csv")
    (tmp_path / "motor.toml").unlink()
    motor = load_motor(motor_of_tests([path], "heatrun calibrate test.csv", has_winding=False))
    assert motor.phase_resistance_ohm is None
    assert not motor.constants


def test_a_channel_that_no_column_holds_is_named(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = named(tmp_path, {"t [s]": TIME_S, "I [A]": CURRENT, "P_V [W]": LOSSES})
    with pytest.raises(InputError, match="a column for winding_degC"):
        motor_of_tests([path], "heatrun calibrate test.csv")


def test_calibrate_without_a_test_is_wrong_use(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "motor.toml").write_text('[motor]\nname = "M"\n')
    assert cli.main(["calibrate", "motor.toml"]) == 2
    assert "no test is given" in capsys.readouterr().err


WINDING_NAMES = (
    "M1.T_winding", "M2_Tw", "M1.WINDING_TEMP",
    "Tcu", "T_cu", "T_Cu", "TCu", "Temp_Cu", "theta_Cu", "theta_w", "Theta_W", "theta_wdg",
    "Tw", "T_w", "Tw_m", "TW1", "T_wdg", "Twdg", "T_Wickl", "TWickl", "T_wind", "Twind",
    "T_wnd", "TWnd", "T_sw", "T_coil", "T_Kupfer", "Kupfertemperatur", "copper_temp",
    "T_rame", "T_cuivre", "ϑ_w", "θ_Cu", "Tcu_mean", "mot_Tcu", "T_slot", "T_Nut", "tempw",
    "winding_temp", "Wicklungstemperatur", "Temperatura avvolgimento", "Température bobinage",
    "Temperatura del devanado", "巻線温度", "モータ巻線温度", "绕组温度", "電機繞組溫度",
)  # fmt: skip

OFFERED = {
    None: ("T_Welle", "T_wall", "wind_speed", "CAN_DataFrame.ID", "CAN_DataFrame.DataLength",
        "WarnUeberstrom", "Verlernzaehler", "Status_EoHVL", "Zeitkonstante",
        "axis0.motor.current_control.Iq_setpoint", "HVTrafo_Phase1_Temp_Avg", "Gear_Oil_Temp_Avg",
        "Pcu", "n_el",),
    "torque_Nm": ("Torque_w", "M", "M1", "M1_filt", "M2.torque", "Coppia", "トルク",),
    "phase_current_A": ("T_current", "M1.I_phase", "current_motor", "Grd_Prod_CurPhse2_Avg",
        "Irms1", "IphRms",
        "Strangstrom", "Corrente di fase", "Courant de phase", "Corriente de fase", "モータ電流",
        "相电流",),
    "coolant_degC": ("Tw_in", "T_Wasser", "T_water", "Twater_in",),
    "coolant_out_degC": ("T_Rücklauf",),
    "time_s": ("ms_today", "経過時間",),
    "dc_voltage_V": ("input_voltage", "vbus_voltage", "Udc",),
    "dc_current_A": ("input_current", "ibus",),
    "controller_degC": ("temp_mos_1", "axis0.motor.fet_thermistor.temperature",
        "Grd_InverterPhase1_Temp_Avg", "InvTemp",),
    "winding_degC": ("temp_motor", "axis0.motor.motor_thermistor.temperature",
        "motor_temperature", "Gen_Phase2_Temp_Avg", "TMot_Wckl\\ETKC:1",),
    "i_d_A": ("d_axis_current", "axis1.motor.current_control.Id_measured",),
    "u_q_V": ("q_axis_voltage",),
    "i_q_A": ("axis0.motor.current_control.Iq_measured", "q_current",),
    "bearing_degC": ("Gen_Bear_Temp_Avg", "軸受温度",),
    "ambient_degC": ("Amb_Temp_Avg", "Ta", "Umgebungstemperatur", "Temperatura ambiente",
        "Température ambiante", "室温", "环境温度",),
    "mechanical_power_W": ("Pm", "P_mech",),
    "electrical_power_W": ("P-ΣA", "Pin", "Potenza assorbita", "Puissance absorbée",
        "aufgenommene Leistung", "输入功率",),
    "stator_degC": ("EM_tStator",),
    "losses_W": ("Ploss", "P_d", "Perdite", "損失",),
    "speed_rpm": ("Velocità", "回転数",),
    "housing_degC": ("Gehäusetemperatur",),
}  # fmt: skip
"""By the channel that each is offered for: parts of words are none, water is no winding; VESC,
ODrive, moteus, SCADA of wind turbines, HIOKI, Yokogawa, INCA, symbols, seven languages."""


@pytest.mark.parametrize("name", WINDING_NAMES)
def test_names_of_the_winding(name):
    assert next(iter(likely_channels(name))) == "winding_degC"


@pytest.mark.parametrize(
    ("channel", "name"), [(c, n) for c, names in OFFERED.items() for n in names]
)
def test_names_of_other_channels_and_of_none(channel, name):
    likely = [channel for channel, score in likely_channels(name).items() if score >= LIKELY]
    assert likely[:1] == ([channel] if channel else [])


def test_a_variable_of_a_mat_file_is_offered_for_the_winding(tmp_path):
    path = tmp_path / "ws.mat"
    columns = {"time": TIME_S, "Irms": CURRENT, "Ploss": LOSSES, "Tamb": ROOM, "Tcu": WINDING}
    scipy.io.savemat(path, columns)
    text = text_of(path)
    assert offered(text, "winding_degC") == ["Tcu"]
    assert offered(text, "ambient_degC") == ["Tamb"]


LOGGERS = {
    "README": ("t [s]", "T_winding [degC]", "I_phase [A]", "P_loss [W]", "T_ambient [degC]"),
    "German": ("Zeit [s]", "Wicklungstemperatur [°C]", "Strangstrom [A]", "Verlustleistung [W]",
               "T_Raum [°C]"),
    "Italian": ("Tempo [s]", "Temperatura avvolgimento [°C]", "Corrente di fase [A]", "Perdite [W]",
                "Temperatura ambiente [°C]"),
    "French": ("Temps [s]", "Température bobinage [°C]", "Courant de phase [A]", "Pertes [W]",
               "Température ambiante [°C]"),
    "Spanish": ("Tiempo [s]", "Temperatura devanado [°C]", "Corriente de fase [A]", "Pérdidas [W]",
                "Temperatura ambiente [°C]"),
    "Japanese": ("経過時間[s]", "巻線温度[℃]", "相電流[A]", "損失[W]", "周囲温度[℃]"),
    "Chinese": ("时间(s)", "绕组温度(℃)", "相电流(A)", "损耗(W)", "环境温度(℃)"),
}  # fmt: skip


@pytest.mark.parametrize("language", LOGGERS)
def test_names_of_which_every_word_is_known_need_no_line(tmp_path, language):
    values = (TIME_S, WINDING, CURRENT, LOSSES, ROOM)
    found = survey(named(tmp_path, dict(zip(LOGGERS[language], values, strict=True))))
    channels = ("time_s", "winding_degC", "phase_current_A", "losses_W", "ambient_degC")
    assert {one.channel: one.column for one in found.recognised} == dict(
        zip(channels, LOGGERS[language], strict=True)
    )


@pytest.mark.parametrize(
    "names",
    [
        ("Winding temp. [°C]", "Coil temp. [°C]"),  # which of the two?
        ("Winding 2 [°C]", "Housing [°C]"),  # where is the first?
        ("Winding limit [°C]", "Housing [°C]"),
        ("Winding temp.", "Housing [°C]"),  # no unit
    ],
)
def test_a_name_that_leaves_something_open_is_not_recognised(tmp_path, names):
    columns = {"time_s": TIME_S, names[0]: WINDING, names[1]: HOUSING}
    assert "winding_degC" not in survey(named(tmp_path, columns)).channels


def test_a_winding_that_only_cools_had_no_load(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    cooling = 60.0 * np.exp(-TIME_S / 900.0) + 20.0 * np.exp(-TIME_S / 60.0)
    columns = {"t [s]": TIME_S, "T_Wicklung [°C]": 22.0 + cooling, "T_Raum [°C]": ROOM}
    path = named(tmp_path, columns, "cooling.csv")
    motor = load_motor(motor_of_tests([path], "heatrun calibrate cooling.csv"))
    assert motor.constants == {"phase_current_A": 0.0, "losses_W": 0.0}
    assert not np.any(read_test(path, motor)["losses_W"])
    warmed = named(tmp_path, columns | {"T_Wicklung [°C]": 102.0 - cooling}, "warmed.csv")
    assert "losses_W" in {gap.channel for gap in gaps([survey(warmed)]) if not gap.is_answered}
