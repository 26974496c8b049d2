"""Columns that `heatrun init` offers for a channel: those that its values speak for come first."""

from __future__ import annotations

import numpy as np
from drafted import (
    BEARING,
    CURRENT,
    HOUSING,
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

BASE = {"time_s": TIME_S, "losses_W": LOSSES}
CHANNELS = {
    "CH1 [degC]": ZERO + 21.0,
    "CH2 [degC]": BEARING,
    "CH3 [degC]": ROOM,
    "CH4 [degC]": HOUSING,
    "CH5 [degC]": WINDING,
    "CH6 [degC]": ZERO,
}


def test_the_temperature_that_moves_the_most_is_first_for_the_winding(tmp_path):
    text = text_of(named(tmp_path, BASE | CHANNELS))
    assert offered(text, "winding_degC") == [
        *("CH5 [degC]", "CH4 [degC]", "CH2 [degC]", "CH3 [degC]", "CH1 [degC]")
    ]
    assert "moves by 66 K, the most" in note_on(text, 'winding_degC = "CH5')
    assert "stays" in note_on(text, 'winding_degC = "CH3')


def test_a_machine_that_cools_moves_as_well(tmp_path):
    columns = {"CH1 [degC]": ROOM, "CH2 [degC]": HOUSING[::-1], "CH3 [degC]": WINDING[::-1]}
    text = text_of(named(tmp_path, BASE | columns))
    assert offered(text, "winding_degC")[0] == "CH3 [degC]"


def test_the_coldest_that_stays_is_first_for_the_ambient(tmp_path):
    text = text_of(named(tmp_path, BASE | CHANNELS))
    sides = offered(text, "ambient_degC")
    assert sides == [f"CH{n} [degC]" for n in (3, 2, 1, 4, 5)]
    assert "the coldest" in note_on(text, 'ambient_degC = "CH3')
    # a channel of zeros is no room
    assert "ambient_degC = 0.0" not in text
    assert "ambient_degC = 21.0" in text


def test_a_phase_current_is_never_negative_and_varies(tmp_path):
    signed = np.where(CURRENT > 50.0, -20.0, 3.0)
    columns = {"CH1 [A]": ZERO + 2.5, "CH2 [A]": signed, "CH3 [A]": CURRENT, "CH4 [A]": CURRENT / 9}
    text = text_of(named(tmp_path, BASE | columns))
    sides = offered(text, "phase_current_A")
    assert sides == ["CH3 [A]", "CH4 [A]", "CH2 [A]", "CH1 [A]"]
    assert "negative" in note_on(text, "CH2 [A]")
    assert "throughout" in note_on(text, "CH1 [A]")


def test_a_name_goes_before_values_unless_they_contradict_it(tmp_path):
    hot = 22.0 + 2.0 * (WINDING - 22.0)
    columns = {"Brake [degC]": hot, "T_Wckl [degC]": WINDING, "T_Raum [degC]": ROOM}
    text = text_of(named(tmp_path, BASE | columns))
    assert offered(text, "winding_degC")[0] == "T_Wckl [degC]"
    columns["T_Wckl [degC]"] = ZERO + 21.0
    text = text_of(named(tmp_path, BASE | columns))
    assert offered(text, "winding_degC") == ["Brake [degC]", "T_Wckl [degC]"]


def test_an_open_thermocouple_is_no_winding(tmp_path):
    broken = ZERO + 1372.0
    broken[:3] = 20.0, 800.0, 1300.0
    columns = {"CH1 [degC]": broken, "CH2 [degC]": WINDING}
    text = text_of(named(tmp_path, BASE | columns))
    assert offered(text, "winding_degC") == ["CH2 [degC]", "CH1 [degC]"]
    assert "outside" in note_on(text, 'winding_degC = "CH1')


def test_units_do_not_change_the_order(tmp_path):
    columns = {"CH1 [degF]": HOUSING * 1.8 + 32.0, "CH2 [K]": WINDING + 273.15, "CH3 [degC]": ROOM}
    text = text_of(named(tmp_path, BASE | columns))
    assert offered(text, "winding_degC") == ["CH2 [K]", "CH1 [degF]", "CH3 [degC]"]
    assert offered(text, "ambient_degC")[0] == "CH3 [degC]"


def test_what_does_not_grow_is_no_time(tmp_path):
    columns = {"Zeitkonstante [s]": WINDING, "Laufzeit [s]": TIME_S[::-1], "Messzeit [s]": TIME_S}
    text = text_of(named(tmp_path, columns | {"losses_W": LOSSES}))
    assert offered(text, "time_s")[0] in ("Messzeit [s]", "Zeitkonstante [s]")
    assert offered(text, "time_s")[-1] == "Laufzeit [s]"


def test_a_short_cold_record_says_nothing_of_the_order(tmp_path):
    columns = {"CH1 [degC]": ROOM, "T_Wckl [degC]": ZERO + 22.0}
    columns["T_Wckl [degC]"][5] = 23.0
    text = text_of(named(tmp_path, BASE | columns))
    assert offered(text, "winding_degC")[0] == "T_Wckl [degC]"
