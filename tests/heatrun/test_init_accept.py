"""`init --accept`, and `calibrate` without a motor file: the best candidates hold."""

from __future__ import annotations

import io
import math

import numpy as np
import pytest
from drafted import CURRENT, HOUSING, LOAD, LOSSES, ROOM, TIME_S, named, offered, text_of

from heatrun import cli
from heatrun.commands.init import motor_of_tests
from heatrun.errors import InputError
from heatrun.init.draft import MOST_LINES, draft
from heatrun.init.survey import survey
from heatrun.motor.file import load_motor, parse_motor
from heatrun.readers.joined import read_test

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
        "winding_degC": "temp_motor [degC]",
        "i_d_A": "d_axis_current [A]",
        "i_q_A": "q_axis_current [A]",
    }


def test_a_q_current_alone_asks_for_that_of_d(tmp_path):
    columns = {"t": TIME_S, "axis0.motor.current_control.Iq_measured": CURRENT,
               "axis0.motor.motor_thermistor.temperature": COIL}  # fmt: skip
    text = accepted(named(tmp_path, columns))
    assert live(text)["i_q_A"] == "axis0.motor.current_control.Iq_measured [A]"
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
    assert offered(text, "winding_degC") == ["A2 [degC]"]


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
    assert cli.main(["calibrate", "test.csv", "--quick"]) == 1
    assert "There is a motor file already" in capsys.readouterr().err


def test_calibrate_without_a_motor_file_asks_at_a_terminal(tmp_path, monkeypatch, capsys):
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.stdin", Terminal("six\n0,0062\n21.5\n"))
    path = named(tmp_path, MISSING)
    motor = load_motor(motor_of_tests([path], "calibrate"))
    assert (motor.phase_resistance_ohm, motor.constants) == (0.0062, {"ambient_degC": 21.5})
    assert "Expected a number, got 'six'" in capsys.readouterr().err
    assert "# Missing:" not in (tmp_path / "motor.toml").read_text(encoding="utf-8")


def test_a_channel_that_no_column_holds_is_named(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = named(tmp_path, {"t [s]": TIME_S, "I [A]": CURRENT, "P_V [W]": LOSSES})
    with pytest.raises(InputError, match="a column for winding_degC"):
        motor_of_tests([path], "calibrate")


def test_calibrate_without_a_test_is_wrong_use(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "motor.toml").write_text('[motor]\nname = "M"\n')
    assert cli.main(["calibrate", "motor.toml"]) == 2
    assert "no test is given" in capsys.readouterr().err
