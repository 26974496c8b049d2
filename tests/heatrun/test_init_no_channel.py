"""What looks like a channel and is none: `heatrun init` says why and does not offer it."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.io
from drafted import (
    BEARING,
    CURRENT,
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

from heatrun.init.gaps import gaps
from heatrun.init.survey import survey

BASE = {"time_s": TIME_S, "losses_W": LOSSES, "ambient_degC": ROOM, "winding_degC": WINDING}
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
    text = text_of(named(tmp_path, BASE | {name: CURRENT * 40.0}))
    assert offered(text, "speed_rpm") == []
    assert "pole pairs" in note_on(text, f"#   {name.partition(' [')[0]}")


@pytest.mark.parametrize("name", ["n [rpm]", "Drehzahl [1/min]", "el motor speed [rpm]", "wheel"])
def test_a_shafts_speed_still_is(tmp_path, name):
    found = survey(named(tmp_path, BASE | {name: CURRENT * 40.0}))
    assert ("speed_rpm" in found.channels) == (name != "wheel")


def test_a_speed_in_hertz_says_why_it_is_none(tmp_path):
    text = text_of(named(tmp_path, BASE | {"speed [Hz]": CURRENT}))
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
    scipy.io.savemat(path, {**BASE, name.partition(" ")[0]: values})
    found = survey(path)
    assert "phase_current_A" not in found.channels
    text = text_of(path)
    assert "1. [winding]" in text
    assert "2. [columns] phase_current_A" in text
    assert offered(text, "phase_current_A") == []
    wanted = "no values" if is_empty else "0 throughout"
    assert wanted in " ".join(text.replace("\n# ", " ").split())


def test_a_silent_channel_of_a_measurement_file_is_told(tmp_path):
    logged = [signal(name, v, TIME_S, "") for name, v in BASE.items() if name != "time_s"]
    path = tmp_path / "bench.mf4"
    written(path, ("Logger", [*logged, signal("phase_current_A", ZERO, TIME_S, "A")]))
    assert "phase_current_A" not in survey(path).channels
    assert "holds 0 throughout" in " ".join(text_of(path).replace("\n# ", " ").split())


def test_a_cooling_record_beside_a_heat_run_leaves_nothing_missing(tmp_path):
    hot = named(tmp_path, BASE | {"phase_current_A": CURRENT})
    cold = named(tmp_path, BASE | {"phase_current_A": ZERO, "losses_W": ZERO}, "cold.csv")
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
    columns = {name: BASE[name] for name in BASE if name != "losses_W"}
    text = text_of(named(tmp_path, columns | {column: CURRENT}))
    assert ("0 where the rotor stands" in text) == is_offered
