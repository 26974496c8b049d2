"""Every unit in every form of header: converted by its own factor or asked for."""

from collections import Counter

import numpy as np
import pytest

from heatrun.errors import InputError
from heatrun.readers.mapping import unit_of
from heatrun.record import header
from heatrun.record.channels import CHANNEL, CHANNELS, REQUIRED
from heatrun.record.header import (
    LONGEST_NAME,
    LONGEST_UNIT,
    plain,
    read_heading,
    split_name,
    unit_of_cell,
)
from heatrun.record.table import Column
from heatrun.record.units import QUANTITIES, Unit, find_unit, refusal, require_unit, to_canonical

COLUMNS = {
    "time": ("time_s", "Zeit"),
    "temperature": ("winding_degC", "T_w"),
    "phase current": ("phase_current_A", "I_ph"),
    "dq current": ("i_d_A", "Id"),
    "direct current": ("dc_current_A", "Idc"),
    "voltage": ("dc_voltage_V", "Udc"),
    "power": ("losses_W", "P_loss"),
    "speed": ("speed_rpm", "n_mot"),
    "torque": ("torque_Nm", "M"),
    "flow": ("coolant_flow_L_per_min", "Vdot"),
    "velocity": ("vehicle_speed_km_per_h", "v"),
    "resistance": ("winding_resistance_ohm", "R_wdg"),
    "fraction": ("fan", "blower"),
}

MARKED = (
    "{0} [{1}]", "{0}[{1}]", "{0}_[{1}]", "[{1}] {0}", "[{1}]{0}", "{0} [{1}] avg", "{0}[{1}]_mean",
    "{0} [ {1} ]", "{0} [in {1}]", "{0} [unit: {1}]", "{0} [{1}, mean]", "{0} [mean {1}]",
    "{0} ({1})", "{0}({1})", "({1}) {0}", "{0} ({1}) avg", "{0} (in {1})", "{0} (unit {1})",
    "{0} (stator) [{1}]", "{0} [{1}] (stator)", "{0} {{{1}}}", "{0}<{1}>", "{0} <{1}>",
    "{0} in {1}", "{0}, in {1}", "{0} in {1} avg", "{0} / {1}", "{0}/{1}", "{0}, {1}", "{0},{1}",
    "# {0} [{1}]", "{0} [{1}]\u200b", "{0}\u00a0[{1}]", "{0}\u202f({1})", "{0}\u00a0in\u2009{1}",
    "{0}［{1}］", "{0}（{1}）", "{0}／{1}", "  {0}   [{1}] ",
)  # fmt: skip
"""Forms in which the unit is marked as one."""

PLAIN = (
    "{0} {1}", "{0}_{1}", "{0}-{1}", "{0}:{1}", "{0}: {1}", "{0}|{1}", "{0} = {1}", "{0} - {1}",
    "{0}.{1}", "{0}\u00a0{1}", "{0}_{1}_mean", "{0}_{1}_avg", "{0} {1} avg", "{0} {1} mean",
    "{0}_mean_{1}", "{0}_{1}_max", "{0} – {1}", "{0}_{1}_2",
)  # fmt: skip
"""Forms in which it is a part of the name."""

LEADING = ("{1} {0}", "{1}_{0}", "{1}: {0}", "{0}_{1}_rotor", "{0} {1} rotor")
"""Forms of the second kind in which only what can be nothing else is told from the name."""


def read(name: str, quantity: str) -> tuple[Unit | None, str]:
    """Return the unit that a column of this name is read in and how it is known."""
    channel = CHANNEL[COLUMNS[quantity][0]]
    column = Column(name, *split_name(name), np.ones(1))
    text, known_from = unit_of(column, channel, "test")
    return require_unit(text or channel.unit, quantity, where="test"), known_from


def spellings():
    for quantity, units in QUANTITIES.items():
        for unit in units:
            for spelling in dict.fromkeys((unit.symbol, *unit.spellings)):
                yield quantity, unit, spelling


def outcome(form: str, quantity: str, unit: Unit, spelling: str) -> str:
    name = form.format(COLUMNS[quantity][1], spelling)
    try:
        found, known_from = read(name, quantity)
    except InputError:
        return "asked"
    if found == unit:
        return known_from
    return f"{name!r} of {quantity} read in {found and found.symbol}, {known_from}"


@pytest.mark.parametrize("form", [*MARKED, *PLAIN, *LEADING])
def test_every_unit_is_converted_or_asked_for(form):
    # A single letter within a name is a part of it: the K of "TC_K_rotor" is a kind of sensor.
    within = form in LEADING and form.startswith("{0}")
    cases = [case for case in spellings() if any(sign.isalpha() for sign in case[2])]
    outcomes = Counter(outcome(form, *case) for case in cases if not (within and len(case[2]) == 1))
    assert set(outcomes) <= {"stated", "name", "assumed", "asked"}


ASKED = {"h", "K", "MW"}
"""Symbols that may as well be a part of the name where no mark sets them off."""


@pytest.mark.parametrize("form", [*MARKED, *PLAIN])
def test_what_benches_write_is_read_and_not_asked_for(form):
    for quantity, units in QUANTITIES.items():
        for unit in units:
            if unit.symbol[0].isalpha() and not (unit.symbol in ASKED and form in PLAIN):
                found = outcome(form, quantity, unit, unit.symbol)
                assert found == "stated" if form in MARKED else found in ("stated", "name")


@pytest.mark.parametrize("form", MARKED)
@pytest.mark.parametrize("wrong", ["kVA", "furlong", "Celcius", "gal/min", "kW", "1/s"])
def test_what_is_marked_and_not_understood_is_asked_for(form, wrong):
    name = form.format("T_w", wrong)
    if wrong == "furlong" and not any(sign in plain(form) for sign in ("[", "in ", " / ", "unit")):
        assert split_name(name)[1] is None  # a word in round brackets is a word
        return
    with pytest.raises(InputError):
        read(name, "temperature")


WHOLE = {
    "temperature": (
        "T_1", "T1", "T_w", "Tw_m", "Te", "Temp_K1", "Temp K1", "T (stator)", "T (front)",
        "Coolant (outlet)", "Coolant (in)", "Coolant in", "T_in", "T_out", "Water in temp",
        "Temperature in stator", "Temperature in the housing", "Temp in slot 3", "pm",
        "Stator Body", "stator_winding", "T_max", "T_min", "T mean", "Winding (max)",
        "Winding, slot 3",
        "Winding / end", "Stator/Rotor", "Rig/T_w", "Bearing DE", "Bearing (NDE)", "T_L1", "T_U",
        "T_U1", "T_V", "Phase U", "T_hs", "T_h", "T_s", "T_us", "TC_K_rotor", "Type K thermocouple",
        "T_ref", "T (core)", "T (secondary)", "T_std", "Temp: stator", "Temp - stator", "T|stator",
        "T-1", "T<stator>", "T = stator", "Kanal 3", "Channel 12", "PT100_1", "T_MW", "T_amb_raw",
        "Temperature of oil", "T_n", "T_d", "Temp 2", "T_A", "T_W", "T_N", "T_Nut", "Hot spot",
    ),
    "speed": ("n", "n_h", "n_mot", "speed", "motor_speed", "Speed (shaft)", "n_soll", "omega_m"),
    "voltage": ("u_d", "u_q", "us", "u_s", "Ud", "U_ph", "Voltage", "u_h"),
    "dq current": ("i_d", "i_q", "Id", "i_s", "iq_ref"),
    "phase current": ("Is", "I_s", "I_1", "Phase Current", "I_U", "I_max", "Imot"),
    "power": ("Pd", "P_loss", "Pv", "Pol", "P_h", "P_s", "losses", "P_el", "P_min", "P_ms"),
    "torque": ("M", "torque", "Torque (shaft)", "M_n", "T_sh", "M_h"),
    "time": ("t", "time", "Zeit", "timestamp", "Time Tag", "t_1", "Time of day", "t_d"),
    "resistance": ("R", "R_U", "Rs", "R_mess", "Widerstand", "winding resistance"),
    "fraction": ("fan", "fan_state", "Lüfter"),
}  # fmt: skip
"""Names of benches in which nothing is a unit, whatever they look like."""


@pytest.mark.parametrize("quantity", WHOLE)
def test_names_without_a_unit_stay_whole(quantity):
    for name in WHOLE[quantity]:
        assert split_name(name) == (name, None)
        found, known_from = read(name, quantity)
        assert (found, known_from) == (QUANTITIES[quantity][0], "assumed"), name


def each(table):
    """Return (quantity, name) of a table by quantity."""
    return [(quantity, name) for quantity, names in table.items() for name in names]


HARMLESS = {
    "temperature": ("T_C", "Housing C"),  # coolant or degC
    "phase current": ("I_A",),  # the first phase or amperes
    "voltage": ("V_dc", "U_V"),
    "power": ("P_W",),
    "time": ("t_s",),
}


@pytest.mark.parametrize(("quantity", "name"), each(HARMLESS))
def test_a_letter_that_changes_nothing_is_taken(name, quantity):
    found, known_from = read(name, quantity)
    assert found == QUANTITIES[quantity][0]
    assert known_from in ("name", "assumed")


OF_TWO_READINGS = {
    "temperature": ("T_f", "Temp K", "Winding F", "T_kW", "kW"),
    "power": ("P_MW", "P_mw", "losses at 10 kW", "P_hp", "P_GW", "P [kW] (W)", "P_kW [W]"),
    "time": ("t h",),
    "phase current": ("I_MA",),
    "speed": ("n_Hz", "speed_rpm [rad/s]"),
}


@pytest.mark.parametrize(("quantity", "name"), each(OF_TWO_READINGS))
def test_what_may_be_read_in_two_ways_is_a_question(name, quantity):
    with pytest.raises(InputError) as caught:
        read(name, quantity)
    assert f'"{name} [' in caught.value.remedy


OTHER_WAYS = {
    "power": {"PlosskW": "kW", "P_kW_1": "kW", "kW": "kW", "Leistung in Kilowatt": "kW",
              "P [kW, mean]": "kW"},
    "speed": {"speedRpm": "rpm", "n in U/min": "rpm", "speed_1/min": "rpm",
              "n_mot 1000 1/min": "krpm", "velocità (giri al minuto)": "rpm"},
    "time": {"timeMs": "ms"},
    "temperature": {"T_K_mean": "K", "Temp°F": "degF", "température en degrés Celsius": "degC"},
    "phase current": {"I [A, peak]": "A_peak", "I_kA_peak": "kA_peak"},
    "torque": {"Drehmoment Newtonmeter": "Nm"},
}  # fmt: skip


@pytest.mark.parametrize(("quantity", "name"), each(OTHER_WAYS))
def test_other_ways_to_write_a_unit(name, quantity):
    found, _ = read(name, quantity)
    assert found is not None
    assert found.symbol == OTHER_WAYS[quantity][name]


@pytest.mark.parametrize("text", ["hh:mm", "mm:ss", "d:hh:mm", "hh:mm:ss.fff", "HH:MM:SS", "min:s"])
@pytest.mark.parametrize("form", ["Time [{}]", "Time ({})", "Time {}", "[{}] Time", "Time in {}"])
def test_a_format_of_clock_times_is_handed_on(form, text):
    assert split_name(form.format(text)) == ("Time", text)
    with pytest.raises(InputError, match=text):  # numbers under it
        read(form.format(text), "time")


@pytest.mark.parametrize(
    "sign", ["(", "[", "{", "<", "()", "[]", ")(", "([", "(a", "_", " ", "/", ",", "-"]
)
def test_a_cell_of_signs_alone_is_bounded(sign):
    for size in (10, 100, LONGEST_NAME // len(sign)):
        split_name("P " + sign * (size - 2))
    with pytest.raises(InputError, match="at most 1000 characters"):
        split_name(sign * 100_000)


def test_work_grows_with_the_length_of_the_cell_alone(monkeypatch):
    lengths: list[int] = []
    looked_at = header._unit_in_bracket

    def counted(content: str, *, is_square: bool) -> str | None:
        lengths.append(len(content))
        return looked_at(content, is_square=is_square)

    monkeypatch.setattr(header, "_unit_in_bracket", counted)
    for size in (100, 200, 400):
        for cell in ("(" * size + ")" * size, "(x)" * size, "([{<" * (size // 4) + ">}])" * 9):
            lengths.clear()
            split_name(cell[: LONGEST_NAME - 1])
            assert sum(lengths) <= 2 * LONGEST_UNIT**2 + 3 * size


CONVERTED = {
    "temperature": {"°C": (20.0, 20.0), "ºC": (20.0, 20.0), "℃": (20.0, 20.0), "C": (20.0, 20.0),
                    "Â°C": (20.0, 20.0), "K": (300.0, 300.0 - 273.15), "°F": (212.0, 100.0),
                    "F": (32.0, 0.0)},
    "speed": {"1/min": (100.0, 100.0), "min⁻¹": (100.0, 100.0), "U/min": (100.0, 100.0),
              "RPM": (100.0, 100.0), "rad/s": (np.pi, 30.0)},
    "torque": {"N·m": (2.0, 2.0), "N m": (2.0, 2.0), "kNm": (2.0, 2000.0), "N・m": (2.0, 2.0),
               "N･m": (2.0, 2.0), "N⋅m": (2.0, 2.0), "N∙m": (2.0, 2.0)},
    "power": {"mW": (2.0, 0.002), "MW": (2.0, 2e6), "kW": (2.0, 2000.0), "KW": (2.0, 2000.0)},
    "phase current": {"A": (2.0, 2.0), "A_rms": (2.0, 2.0), "A_peak": (np.sqrt(2.0), 1.0),
                      "A amplitude": (np.sqrt(2.0), 1.0)},
    "dq current": {"A_rms": (1.0, np.sqrt(2.0))},
    "time": {"ms": (250.0, 0.25), "µs": (250.0, 250e-6), "min": (1.5, 90.0), "h": (1.5, 5400.0)},
    "velocity": {"m/s": (10.0, 36.0)},
    "flow": {"m³/h": (1.2, 20.0), "l/min": (6.0, 6.0)},
    "fraction": {"%": (50.0, 0.5)},
}  # fmt: skip
"""By quantity and spelling: a value in that unit, and in the channel's."""


@pytest.mark.parametrize(("quantity", "spelling"), each(CONVERTED))
def test_conversion(quantity, spelling):
    value, expected = CONVERTED[quantity][spelling]
    unit = require_unit(spelling, quantity, where="test")
    # The factors are doubles: two roundings.
    found = float(to_canonical(np.array([value]), unit)[0])
    assert found == pytest.approx(expected, rel=4e-16, abs=1e-13)


def test_the_first_unit_of_each_quantity_changes_nothing():
    values = np.array([0.1, -7.0])
    for units in QUANTITIES.values():
        assert to_canonical(values, units[0]) is values


def test_no_spelling_means_two_units_of_a_quantity():
    for quantity, units in QUANTITIES.items():
        for unit in units:
            for spelling in (unit.symbol, *unit.spellings):
                assert find_unit(spelling, quantity) is unit, (quantity, spelling)


def test_every_channel_has_its_unit():
    for channel in CHANNELS:
        unit = require_unit(channel.unit, channel.quantity, where=channel.name)
        assert (unit.factor, unit.offset) == (1.0, 0.0)
    assert [channel.name for channel in CHANNELS[:5]] == list(REQUIRED)


@pytest.mark.parametrize("spelling", ["Hz", "hz", "1/s", "eRPM"])
def test_a_speed_that_is_none_is_refused_with_the_reason(spelling):
    with pytest.raises(InputError, match="refused because"):
        require_unit(spelling, "speed", where="column 'n'")


def test_an_unknown_unit_names_the_closest_and_the_accepted():
    with pytest.raises(InputError, match="Did you mean Celsius") as caught:
        require_unit("Celcius", "temperature", where="column 'T'")
    assert caught.value.where == "column 'T'"
    assert "degC, K, degF" in caught.value.remedy


def test_a_unit_of_another_quantity_is_named():
    with pytest.raises(InputError, match="got kW, a unit of power"):
        require_unit("kW", "temperature", where="column 'T'")


SPLIT = {
    "T_winding [degC]": ("T_winding", "degC"), "Winding Temp (°C)": ("Winding Temp", "°C"),
    "Temperature (stator)": ("Temperature (stator)", None),
    "Temperature (stator) [K]": ("Temperature (stator)", "K"),
    "T (Celcius)": ("T", "Celcius"), "T [furlong]": ("T", "furlong"), "P / W": ("P", "W"),
    "n/min-1": ("n", "min-1"), "Speed in rpm": ("Speed", "rpm"),
    "Speed in rad/s": ("Speed", "rad/s"), "speed rad/s": ("speed", "rad/s"),
    "n / 1/min": ("n", "1/min"), "Torque, Nm": ("Torque", "Nm"), "torque_Nm": ("torque_Nm", None),
    "I (A rms)": ("I", "A rms"), "km/h": ("km/h", None), "": ("", None), "[s]": ("[s]", None),
}  # fmt: skip


@pytest.mark.parametrize("name", SPLIT)
def test_names_with_units(name):
    assert split_name(name) == SPLIT[name]


@pytest.mark.parametrize(
    ("cell", "unit"),
    [("[degC]", "degC"), ("(s)", "s"), ("rpm", "rpm"), ("", None), ("T_w", None), ("[foo]", "foo")],
)
def test_cells_of_a_row_of_units(cell, unit):
    assert unit_of_cell(cell) == unit


IN_OTHER_LETTERS = {
    "Ток фазы, А": ("Ток фазы", "phase current", 1.0),
    "Потери, кВт": ("Потери", "power", 1e3),
    "Частота вращения [об/мин]": ("Частота вращения", "speed", 1.0),
    "Момент, Н·м": ("Момент", "torque", 1.0),
    "Varvtal [varv/min]": ("Varvtal", "speed", 1.0),
    "TORQUE (lbf-in)": ("TORQUE", "torque", 0.1129848290276167),
    "Torque [in-ozf]": ("Torque", "torque", 0.00706155181422604),
    "Torque (kgf.cm)": ("Torque", "torque", 0.0980665),
}


@pytest.mark.parametrize("name", IN_OTHER_LETTERS)
def test_units_in_cyrillic_and_products_in_any_order(name):
    label, quantity, factor = IN_OTHER_LETTERS[name]
    heading = read_heading(name)
    assert heading.label == label
    unit = find_unit(heading.units[0], quantity)
    assert unit is not None
    assert unit.factor == pytest.approx(factor, rel=1e-12)


def test_a_unit_that_is_not_accepted_is_asked_for_in_round_brackets_too():
    assert read_heading("Torque (kg-m)").units == ("kg-m",)
    assert refusal("g/min", "speed")
    assert refusal("g/min", "flow")
    assert read_heading("Current (A-C)").units == ()
