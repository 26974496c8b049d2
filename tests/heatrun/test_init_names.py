"""Short names of the field: which channel `heatrun init` offers a column for."""

from __future__ import annotations

import pytest
import scipy.io
from drafted import CURRENT, LOSSES, ROOM, TIME_S, WINDING, offered, text_of

from heatrun.bench.channels.likely_names import likely_channels

WINDING_NAMES = (
    "Tcu", "T_cu", "T_Cu", "TCu", "Temp_Cu", "theta_Cu", "theta_w", "Theta_W", "theta_wdg",
    "Tw", "T_w", "Tw_m", "TW1", "T_wdg", "Twdg", "T_Wickl", "TWickl", "T_wind", "Twind",
    "T_wnd", "TWnd", "T_sw", "T_coil", "T_Kupfer", "Kupfertemperatur", "copper_temp",
    "T_rame", "T_cuivre", "ϑ_w", "θ_Cu", "Tcu_mean", "mot_Tcu", "T_slot", "T_Nut", "tempw",
    "winding_temp",
)  # fmt: skip

OTHER_NAMES = {
    "T_Wasser": "coolant_degC",
    "T_water": "coolant_degC",
    "Twater_in": "coolant_degC",
    "T_Welle": None,
    "T_wall": None,
    "Torque_w": None,
    "wind_speed": "speed_rpm",
    "T_current": "phase_current_A",
    "Tcurve": None,
    "Tw_in": None,
    "T_cutoff": None,
}


@pytest.mark.parametrize("name", WINDING_NAMES)
def test_names_of_the_winding(name):
    assert likely_channels(name)[:1] == ("winding_degC",)


@pytest.mark.parametrize("name", OTHER_NAMES)
def test_names_of_something_else(name):
    assert "winding_degC" not in likely_channels(name)
    wanted = OTHER_NAMES[name]
    assert wanted is None or wanted in likely_channels(name)


def test_a_variable_of_a_mat_file_is_offered_for_the_winding(tmp_path):
    path = tmp_path / "ws.mat"
    columns = {"time": TIME_S, "Irms": CURRENT, "Ploss": LOSSES, "Tamb": ROOM, "Tcu": WINDING}
    scipy.io.savemat(path, columns)
    text = text_of(path)
    assert offered(text, "winding_degC") == ["Tcu [degC]"]
    assert offered(text, "ambient_degC") == ["Tamb [degC]"]
