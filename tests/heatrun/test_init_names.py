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
    # parts of words are none
    "T_Welle": None,
    "T_wall": None,
    "Torque_w": "torque_Nm",
    "wind_speed": None,
    "T_current": "phase_current_A",
    "Tw_in": "coolant_degC",
    "CAN_DataFrame.ID": None,
    "CAN_DataFrame.DataLength": None,
    "WarnUeberstrom": None,
    "Verlernzaehler": None,
    "Status_EoHVL": None,
    "Zeitkonstante": None,
    # water, not winding
    "T_Wasser": "coolant_degC",
    "T_water": "coolant_degC",
    "Twater_in": "coolant_degC",
    "T_Rücklauf": "coolant_out_degC",
    # VESC, ODrive, moteus
    "ms_today": "time_s",
    "input_voltage": "dc_voltage_V",
    "input_current": "dc_current_A",
    "temp_mos_1": "controller_degC",
    "temp_motor": "winding_degC",
    "current_motor": "phase_current_A",
    "d_axis_current": "i_d_A",
    "q_axis_voltage": "u_q_V",
    "axis0.motor.fet_thermistor.temperature": "controller_degC",
    "axis0.motor.motor_thermistor.temperature": "winding_degC",
    "axis0.motor.current_control.Iq_measured": "i_q_A",
    "axis1.motor.current_control.Id_measured": "i_d_A",
    "axis0.motor.current_control.Iq_setpoint": None,
    "vbus_voltage": "dc_voltage_V",
    "ibus": "dc_current_A",
    "motor_temperature": "winding_degC",
    "q_current": "i_q_A",
    # SCADA of wind turbines
    "Gen_Phase2_Temp_Avg": "winding_degC",
    "Gen_Bear_Temp_Avg": "bearing_degC",
    "Amb_Temp_Avg": "ambient_degC",
    "Grd_Prod_CurPhse2_Avg": "phase_current_A",
    "Grd_InverterPhase1_Temp_Avg": "controller_degC",
    "HVTrafo_Phase1_Temp_Avg": None,
    "Gear_Oil_Temp_Avg": None,
    # HIOKI, Yokogawa, INCA
    "Irms1": "phase_current_A",
    "Pm": "mechanical_power_W",
    "P-ΣA": "electrical_power_W",
    "TMot_Wckl\\ETKC:1": "winding_degC",
    "EM_tStator": "stator_degC",
    "InvTemp": "controller_degC",
    "IphRms": "phase_current_A",
    # symbols
    "Ploss": "losses_W",
    "P_d": "losses_W",
    "Pcu": None,
    "Pin": "electrical_power_W",
    "P_mech": "mechanical_power_W",
    "Udc": "dc_voltage_V",
    "Ta": "ambient_degC",
    "n_el": None,
    "M": "torque_Nm",
    # seven languages
    "Umgebungstemperatur": "ambient_degC",
    "Temperatura ambiente": "ambient_degC",
    "Température ambiante": "ambient_degC",
    "室温": "ambient_degC",
    "环境温度": "ambient_degC",
    "Strangstrom": "phase_current_A",
    "Corrente di fase": "phase_current_A",
    "Courant de phase": "phase_current_A",
    "Corriente de fase": "phase_current_A",
    "モータ電流": "phase_current_A",
    "相电流": "phase_current_A",
    "Perdite": "losses_W",
    "損失": "losses_W",
    "Potenza assorbita": "electrical_power_W",
    "Puissance absorbée": "electrical_power_W",
    "aufgenommene Leistung": "electrical_power_W",
    "输入功率": "electrical_power_W",
    "Coppia": "torque_Nm",
    "トルク": "torque_Nm",
    "Velocità": "speed_rpm",
    "回転数": "speed_rpm",
    "Gehäusetemperatur": "housing_degC",
    "軸受温度": "bearing_degC",
    "経過時間": "time_s",
}


@pytest.mark.parametrize("name", WINDING_NAMES)
def test_names_of_the_winding(name):
    assert next(iter(likely_channels(name))) == "winding_degC"


@pytest.mark.parametrize("name", NAMES)
def test_names_of_other_channels_and_of_none(name):
    likely = [channel for channel, score in likely_channels(name).items() if score >= LIKELY]
    assert likely[:1] == ([NAMES[name]] if NAMES[name] else [])


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
