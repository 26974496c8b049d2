"""Names of the field: which channel `heatrun init` offers a column for, and which it recognises."""

from __future__ import annotations

import pytest
import scipy.io
from drafted import CURRENT, HOUSING, LOSSES, ROOM, TIME_S, WINDING, named, offered, text_of

from heatrun.init.survey import survey
from heatrun.readers.likely_names import LIKELY, likely_channels

WINDING_NAMES = (
    "Tcu", "T_cu", "T_Cu", "TCu", "Temp_Cu", "theta_Cu", "theta_w", "Theta_W", "theta_wdg",
    "Tw", "T_w", "Tw_m", "TW1", "T_wdg", "Twdg", "T_Wickl", "TWickl", "T_wind", "Twind",
    "T_wnd", "TWnd", "T_sw", "T_coil", "T_Kupfer", "Kupfertemperatur", "copper_temp",
    "T_rame", "T_cuivre", "ϑ_w", "θ_Cu", "Tcu_mean", "mot_Tcu", "T_slot", "T_Nut", "tempw",
    "winding_temp", "Wicklungstemperatur", "Temperatura avvolgimento", "Température bobinage",
    "Temperatura del devanado", "巻線温度", "モータ巻線温度", "绕组温度", "電機繞組溫度",
)  # fmt: skip

NAMES = {
    None: ("T_Welle", "T_wall", "wind_speed", "CAN_DataFrame.ID", "CAN_DataFrame.DataLength",
        "WarnUeberstrom", "Verlernzaehler", "Status_EoHVL", "Zeitkonstante",
        "axis0.motor.current_control.Iq_setpoint", "HVTrafo_Phase1_Temp_Avg", "Gear_Oil_Temp_Avg",
        "Pcu", "n_el",),
    "torque_Nm": ("Torque_w", "M", "Coppia", "トルク",),
    "phase_current_A": ("T_current", "current_motor", "Grd_Prod_CurPhse2_Avg", "Irms1", "IphRms",
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


@pytest.mark.parametrize(("channel", "name"), [(c, n) for c, names in NAMES.items() for n in names])
def test_names_of_other_channels_and_of_none(channel, name):
    likely = [channel for channel, score in likely_channels(name).items() if score >= LIKELY]
    assert likely[:1] == ([channel] if channel else [])


def test_a_variable_of_a_mat_file_is_offered_for_the_winding(tmp_path):
    path = tmp_path / "ws.mat"
    columns = {"time": TIME_S, "Irms": CURRENT, "Ploss": LOSSES, "Tamb": ROOM, "Tcu": WINDING}
    scipy.io.savemat(path, columns)
    text = text_of(path)
    assert offered(text, "winding_degC") == ["Tcu [degC]"]
    assert offered(text, "ambient_degC") == ["Tamb [degC]"]


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
