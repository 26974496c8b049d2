"""Sensors of the three phases: `heatrun init` offers their mean."""

from __future__ import annotations

import numpy as np
import pytest
from drafted import (
    BEARING,
    CURRENT,
    HOUSING,
    LOSSES,
    ROOM,
    TIME_S,
    WINDING,
    named,
    offered,
    text_of,
)
from mdf_files import signal, written

from heatrun.motor.file import parse_motor
from heatrun.readers.joined import read_test

BASE = {"time_s": TIME_S, "losses_W": LOSSES, "phase_current_A": CURRENT, "ambient_degC": ROOM}
UVW = (WINDING + 1.5, WINDING, WINDING - 1.0)


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
    path = named(tmp_path, {"PT100_4 [degC]": BEARING} | BASE | columns)
    text = text_of(path)
    side = offered(text, "winding_degC")[0]
    assert side == f"mean({', '.join(name.rpartition(' ')[0] for name in names)})"
    motor = parse_motor(taken(text, "winding_degC", side).encode(), "motor.toml")
    found = read_test(path, motor)["winding_degC"]
    np.testing.assert_allclose(found, np.mean(UVW, axis=0), atol=1e-2)


def test_the_unit_of_bare_names_stands_behind_the_mean(tmp_path):
    names = ("coil_U", "coil_V", "coil_W")
    path = named(tmp_path, BASE | dict(zip(names, UVW, strict=True)))
    text = text_of(path)
    assert offered(text, "winding_degC")[0] == "mean(coil_U, coil_V, coil_W) [degC]"
    motor = taken(text, "winding_degC", "mean(coil_U, coil_V, coil_W) [degC]")
    assert "winding_degC" in read_test(path, parse_motor(motor.encode(), "motor.toml"))


def test_the_same_letters_of_other_things_are_no_phases(tmp_path):
    """Umgebung, Vorlauf and Wicklung: T_U, T_V and T_W of a German bench."""
    columns = {"T_U [degC]": ROOM, "T_V [degC]": BEARING, "T_W [degC]": WINDING}
    del (base := dict(BASE))["ambient_degC"]
    text = text_of(named(tmp_path, base | columns))
    assert "mean(" not in text.split("\n[columns]\n")[1]
    assert offered(text, "winding_degC")[0] == "T_W [degC]"
    assert offered(text, "ambient_degC")[0] == "T_U [degC]"


def test_a_loose_sensor_is_not_averaged(tmp_path):
    columns = dict(zip(("T_U [degC]", "T_V [degC]", "T_W [degC]"), UVW, strict=True))
    columns["T_V [degC]"] = HOUSING
    text = text_of(named(tmp_path, BASE | columns))
    assert "mean(" not in text.split("\n[columns]\n")[1]


def test_three_of_the_housing_do_not_go_before_the_winding(tmp_path):
    columns = {f"T{n} [degC]": HOUSING + n / 10 for n in (1, 2, 3)} | {"T4 [degC]": WINDING}
    sides = offered(text_of(named(tmp_path, BASE | columns)), "winding_degC")
    assert sides[:2] == ["T4 [degC]", "mean(T1, T2, T3)"]


def test_three_phase_currents_are_one(tmp_path):
    columns = {f"I{n} [A]": CURRENT * (0.99 + 0.01 * n) for n in (1, 2, 3)}
    base = {name: values for name, values in BASE.items() if name != "phase_current_A"}
    path = named(tmp_path, base | columns | {"winding_degC": WINDING})
    text = text_of(path)
    assert offered(text, "phase_current_A")[0] == "mean(I1, I2, I3)"


def test_channels_of_a_measurement_file_are_averaged_too(tmp_path):
    time = TIME_S
    logged = [signal(f"TC_Wdg_{p}", v, time, "°C") for p, v in zip("UVW", UVW, strict=True)]
    drive = [signal(name, v, time, "") for name, v in BASE.items() if name != "time_s"]
    path = tmp_path / "bench.mf4"
    written(path, ("Logger", logged), ("Drive", drive))
    text = text_of(path)
    side = "mean(TC_Wdg_U, TC_Wdg_V, TC_Wdg_W)"
    assert offered(text, "winding_degC")[0] == side
    motor = parse_motor(taken(text, "winding_degC", side).encode(), "motor.toml")
    assert "winding_degC" in read_test(path, motor)
