"""The channel map: precedence, known benches, and what is refused."""

import numpy as np
import pytest

from heatrun.errors import InputError
from heatrun.readers.channel_map import map_columns
from heatrun.record.channels import CHANNEL, COLUMN_MAPS
from heatrun.record.header import split_name
from heatrun.record.table import Column, Stated, Table


def table(*names: str, value: float = 1.0, **constants: float) -> Table:
    columns = tuple(Column(name, *split_name(name), np.array([value, 2.0])) for name in names)
    return Table(columns, {"state": "RUN"}, constants)


def mapped(*names: str, columns: dict[str, str] | None = None, value: float = 1.0, **more):
    return map_columns(table(*names, value=value), columns, where="test.csv", **more)


def test_canonical_names_come_before_built_in_ones():
    found = mapped("winding_degC", "stator_winding", "motor_speed", "u_d", "i_d", "pm", value=3.0)
    assert found.channels["winding_degC"][0] == 3.0
    assert "stator_winding" in found.unused


def test_columns_of_the_motor_file_come_first():
    found = mapped("winding_degC", "Twarm (K)", columns={"winding_degC": "Twarm"}, value=293.15)
    np.testing.assert_allclose(found.channels["winding_degC"][0], 20.0, atol=1e-12)
    assert found.unused == ("winding_degC", "state")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("T_coil [degC]", 300.0),  # the header as it stands
        ("T_coil", 300.0),  # without its unit
        ("T_coil [°C]", 300.0),  # another spelling
        ("T_coil [K]", 26.85),  # against the file: obeyed, with a finding
    ],
)
def test_ways_to_name_a_column(text, expected):
    found = mapped("T_coil [degC]", columns={"winding_degC": text}, value=300.0)
    np.testing.assert_allclose(found.channels["winding_degC"][0], expected, atol=1e-12)
    overridden = [finding.id for finding in found.findings]
    assert overridden == (["unit_overridden"] if text == "T_coil [K]" else [])


def test_a_unit_that_only_the_motor_file_gives():
    found = mapped("P", columns={"losses_W": "P [kW]"}, value=1.5)
    assert found.channels["losses_W"][0] == 1500.0
    assert found.findings == []


def test_a_column_without_a_unit_is_noted():
    found = mapped("coil", columns={"winding_degC": "coil"}, value=20.0)
    assert "no unit given, taken as degC" in found.notes[0]


@pytest.mark.parametrize(
    ("name", "text", "factor", "unit_from"),
    [
        ("P_loss kW", "P_loss kW", 1e3, "name"),
        ("P_loss kW", "P_loss", 1e3, "name"),
        ("P_loss kW", "P_loss [W]", 1.0, "stated"),
        ("[kW] P_loss", "P_loss", 1e3, "stated"),
        ("[kW] P_loss", "[kW] P_loss", 1e3, "stated"),
        ("[furlong] P_loss", "[furlong] P_loss [kW]", 1e3, "stated"),
        ("P|kW", "P", 1e3, "stated"),
        ("P<kW>", "P<kW>", 1e3, "stated"),
        ("Pv_kW_mean", "Pv_kW_mean", 1e3, "name"),
        ("P\u00a0[kW]", "P [kW]", 1e3, "stated"),
        ("P_loss", "P_loss", 1.0, "assumed"),
        ("P (in kW)", "P in kW", 1e3, "stated"),
    ],
)
def test_columns_of_the_motor_file_name_headers_of_every_form(name, text, factor, unit_from):
    found = mapped(name, columns={"losses_W": text}, value=2.0)
    assert found.channels["losses_W"][0] == 2.0 * factor
    (reading,) = found.readings
    assert (reading.column, reading.unit_from) == (name, unit_from)


def test_a_letter_at_the_end_is_not_left_off_the_name_asked_for():
    with pytest.raises(InputError, match="names 'T' for coolant_degC, which the file does not"):
        mapped("T_K", columns={"coolant_degC": "T"})


@pytest.mark.parametrize(
    ("name", "channel", "factor"),
    [
        ("losses_kW_avg", "losses_W", 1e3),
        ("Losses kW", "losses_W", 1e3),
        ("[kW] losses", "losses_W", 1e3),
        ("speedRpm", "speed_rpm", 1.0),
        ("torque mNm mean", "torque_Nm", 1e-3),
        ("phase_current_rms [A]", "phase_current_A", 1.0),
        ("phase_current_kA_rms", "phase_current_A", 1e3),
        ("time, min", "time_s", 60.0),
    ],
)
def test_built_in_names_with_units_and_means(name, channel, factor):
    assert mapped(name, value=8.0).channels[channel][0] == pytest.approx(8.0 * factor, rel=1e-15)


@pytest.mark.parametrize("name", ["winding_max", "Winding F", "winding_degC_std", "i_d_rms"])
def test_what_is_no_mean_is_not_taken_for_the_channel(name):
    assert not {"winding_degC", "i_d_A"} & set(mapped(name, "x").channels)


def test_the_plain_name_comes_before_its_mean():
    found = mapped("winding_mean [degC]", "winding [degC]")
    assert found.taken["winding_degC"].name == "winding [degC]"
    found = mapped("winding_min", "winding_mean [K]", "winding_max", value=293.15)
    assert found.taken["winding_degC"].name == "winding_mean [K]"
    with pytest.raises(InputError, match="both stand for winding_degC"):
        mapped("winding_mean [degC]", "winding_avg [degC]")


def test_a_unit_that_is_not_understood_matters_where_it_is_used():
    assert "P [furlong]" in mapped("t", "P [furlong]").unused
    with pytest.raises(InputError, match=r"The unit 'furlong' is not known") as caught:
        mapped("P [furlong]", columns={"losses_W": "P"})
    assert "'P [furlong]' as losses_W" in caught.value.where
    assert '[columns] losses_W = "P [furlong] [UNIT]"' in caught.value.remedy
    line = "P [furlong] [kW]"
    found = mapped("P [furlong]", columns={"losses_W": line}, value=2.0)
    assert found.channels["losses_W"][0] == 2000.0
    assert [finding.id for finding in found.findings] == ["unit_overridden"]


def column_with(name: str, *beside: Stated) -> Table:
    values = np.array([2.0, 3.0])
    return Table((Column(name, *split_name(name), values, beside=beside),))


def read_power(name: str, *beside: Stated, text: str = ""):
    columns = {"losses_W": text or split_name(name)[0]}
    found = map_columns(column_with(name, *beside), columns, where="test.csv")
    (reading,) = found.readings
    return found.channels["losses_W"][0], reading.unit_from, [one.id for one in found.findings]


@pytest.mark.parametrize(
    ("name", "beside", "said"),
    [
        ("P [kW]", "W", ("The name says kW", "the row of units W")),
        ("P_kW", "W", ("The name says kW", "the row of units W")),
        ("losses_W", "kW", ("The name says W", "the row of units kW")),
        ("P [kW] (W)", "kW", ("The name says kW", "the unit behind it W")),
    ],
)
def test_two_statements_that_contradict_each_other_are_both_named(name, beside, said):
    row = Stated(beside, "the row of units")
    with pytest.raises(InputError) as caught:
        read_power(name, row)
    for words in said:
        assert words in caught.value.problem
    assert f'"{name} [W]"' in caught.value.remedy
    for unit, factor in (("W", 1.0), ("kW", 1e3)):
        value, unit_from, findings = read_power(name, row, text=f"{name} [{unit}]")
        assert (value, unit_from) == (2.0 * factor, "stated")
        assert findings == ["unit_overridden"]


def test_statements_that_agree_are_one():
    row = Stated("Kilowatt", "the row of units")
    assert read_power("P_kW [kW]", row) == (2000.0, "stated", [])
    line = Stated("kW", "the line 'P in kW'")
    assert read_power("P", row, line) == (2000.0, "stated", [])


def test_what_a_line_says_of_all_columns_gives_way_to_what_stands_at_one():
    line = Stated("kW", "the line 'powers in kW'", "quantity")
    assert read_power("P", line) == (2000.0, "stated", [])
    assert read_power("P [W]", line) == (2.0, "stated", [])
    unclear = Stated("kW", "the line 'rated power in kW'", "unclear")
    assert read_power("P_W", unclear)[0] == 2.0
    with pytest.raises(InputError, match="'rated power in kW' mentions kW") as caught:
        read_power("P", unclear)
    assert '"P [W]" or [columns] losses_W = "P [kW]"' in caught.value.remedy
    assert read_power("P", Stated("W", "the line 'rated power in W'", "unclear"))[1] == "assumed"


def test_the_name_of_a_line_is_bounded():
    with pytest.raises(InputError, match="at most 1000 characters, got 100000") as caught:
        mapped("P", columns={"losses_W": "(" * 100_000})
    assert "[columns] losses_W" in caught.value.where


def test_typo_in_a_channel_or_a_column():
    with pytest.raises(InputError, match=r"'winding_degc', which is not known. .*'winding_degC'"):
        mapped("T_coil", columns={"winding_degc": "T_coil"})
    with pytest.raises(InputError, match=r"'T_coll' for winding_degC.*'T_coil'") as caught:
        mapped("T_coil", "P", columns={"winding_degC": "T_coll"})
    assert "Columns are: T_coil, P." in caught.value.remedy


def test_one_file_of_a_test_need_not_have_all_columns():
    found = mapped("Tcoil", columns={"winding_degC": "Tcoil", "losses_W": "P"}, is_part=True)
    assert set(found.channels) == {"winding_degC"}
    assert any("no column 'P'" in note for note in found.notes)


def test_a_column_of_text_is_refused():
    with pytest.raises(InputError, match="holds the text 'RUN', expected numbers"):
        mapped("a", columns={"fan": "state"})


@pytest.mark.parametrize(
    ("names", "columns", "channel"),
    [
        (("T", "T"), {"winding_degC": "T"}, "winding_degC"),
        (("T [degC]", "T [K]"), {"winding_degC": "T"}, "winding_degC"),
        (("winding_degC", "winding_degC"), None, "winding_degC"),
        (("torque (Nm)", "torque_mNm"), None, "torque_Nm"),
        (("timestamp", "datetime"), None, "time_s"),
    ],
)
def test_two_columns_for_one_channel_are_both_named(names, columns, channel):
    with pytest.raises(InputError, match=f"both stand for {channel}") as caught:
        mapped(*names, columns=columns)
    for name in names:
        assert f"'{name}'" in caught.value.problem


@pytest.mark.parametrize(
    ("channels", "severity"),
    [
        (("ambient_degC", "coolant_degC"), "warning"),
        (("ambient_degC", "winding_degC"), "error"),
        (("winding_degC", "losses_W"), "error"),
        (("losses_W", "phase_current_A"), "error"),
    ],
)
def test_one_column_for_two_channels_is_doubted(channels, severity):
    found = mapped("T", columns=dict.fromkeys(channels, "T"))
    twice = [one for one in found.findings if one.id == "column_used_twice"]
    assert [one.severity for one in twice] == [severity]
    assert " and as ".join(channels) in twice[0].message


@pytest.mark.parametrize(
    ("name", "channel", "factor"),
    [
        ("winding_K", "winding_degC", None),
        ("torque_mNm", "torque_Nm", 1e-3),
        ("Speed (1/min)", "speed_rpm", 1.0),
        ("speed in rad/s", "speed_rpm", 30.0 / np.pi),
        ("time_ms", "time_s", 1e-3),
        ("Zeit [h]", "time_s", 3600.0),
        ("Losses / kW", "losses_W", 1e3),
        ("phase_current_A_peak", "phase_current_A", 1.0 / np.sqrt(2.0)),
        ("coolant_flow (l/h)", "coolant_flow_L_per_min", 1.0 / 60.0),
        ("fan [%]", "fan", 0.01),
    ],
)
def test_canonical_names_with_another_unit(name, channel, factor):
    found = mapped(name, value=8.0)
    expected = 8.0 - 273.15 if factor is None else 8.0 * factor
    np.testing.assert_allclose(found.channels[channel][0], expected, rtol=1e-15)


def test_a_symbol_is_not_taken_without_regard_to_case():
    assert "time_s" not in mapped("T", "PM", "x").channels
    assert "time_s" in mapped("t", "T").channels


def test_a_name_that_contradicts_its_unit_is_refused():
    with pytest.raises(InputError, match="The name says degC, the unit behind it K"):
        mapped("winding_degC [K]")


def test_a_speed_in_hertz_is_refused_and_can_be_left_out():
    with pytest.raises(InputError, match="refused because") as caught:
        mapped("speed [Hz]")
    assert 'speed_rpm = "none"' in caught.value.remedy
    assert mapped("speed [Hz]", columns={"speed_rpm": "none"}).channels == {}


def test_an_amplitude_that_is_read_as_rms_is_doubted():
    found = mapped("I_peak [A]", columns={"phase_current_A": "I_peak"})
    assert [finding.id for finding in found.findings] == ["current_maybe_amplitude"]
    found = mapped("I_peak", columns={"phase_current_A": "I_peak [A_peak]"})
    assert found.findings == []


def test_built_in_maps_name_channels_that_exist():
    for column_map in COLUMN_MAPS:
        assert set(column_map.entries.values()) <= set(CHANNEL)
        assert set(column_map.units) | column_map.zero_means_absent <= set(column_map.entries)


def test_thesis_names():
    found = mapped("t", "Is", "Pd", "Te", "Tw_m")
    assert set(found.channels) == {
        *("time_s", "phase_current_A", "losses_W", "ambient_degC", "winding_degC")
    }
    # Alone, the symbols of the thesis mean nothing.
    assert set(mapped("Is", "x").channels) == set()


def test_paderborn_names():
    names = "u_d u_q i_d i_q motor_speed torque coolant ambient stator_winding stator_tooth"
    found = mapped(*names.split(), "stator_yoke", "pm", "profile_id")
    assert set(found.channels) == {
        *("u_d_V", "u_q_V", "i_d_A", "i_q_A", "speed_rpm", "torque_Nm", "coolant_degC"),
        *("ambient_degC", "winding_degC", "tooth_degC", "yoke_degC", "magnet_degC"),
    }
    assert found.unused == ("profile_id", "state")
