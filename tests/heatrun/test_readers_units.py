"""Units at the border: every spelling of the table, what is refused, and names with units."""

from __future__ import annotations

import numpy as np
import pytest

from heatrun.errors import InputError
from heatrun.record.channels import CHANNELS, REQUIRED
from heatrun.record.header import split_name, unit_of_cell
from heatrun.record.units import QUANTITIES, find_unit, require_unit, to_canonical


def converted(value: float, spelling: str, quantity: str) -> float:
    unit = require_unit(spelling, quantity, where="test")
    return float(to_canonical(np.array([value]), unit)[0])


@pytest.mark.parametrize(
    ("value", "spelling", "quantity", "expected"),
    [
        (20.0, "°C", "temperature", 20.0),
        (20.0, "ºC", "temperature", 20.0),
        (20.0, "℃", "temperature", 20.0),
        (20.0, "C", "temperature", 20.0),
        (20.0, "Â°C", "temperature", 20.0),
        (300.0, "K", "temperature", 300.0 - 273.15),
        (212.0, "°F", "temperature", 100.0),
        (32.0, "F", "temperature", 0.0),
        (100.0, "1/min", "speed", 100.0),
        (100.0, "min⁻¹", "speed", 100.0),
        (100.0, "U/min", "speed", 100.0),
        (100.0, "RPM", "speed", 100.0),
        (np.pi, "rad/s", "speed", 30.0),
        (2.0, "N·m", "torque", 2.0),
        (2.0, "N m", "torque", 2.0),
        (2.0, "kNm", "torque", 2000.0),
        (2.0, "mW", "power", 0.002),
        (2.0, "MW", "power", 2e6),
        (2.0, "kW", "power", 2000.0),
        (2.0, "KW", "power", 2000.0),
        (2.0, "A", "phase current", 2.0),
        (2.0, "A_rms", "phase current", 2.0),
        (np.sqrt(2.0), "A_peak", "phase current", 1.0),
        (np.sqrt(2.0), "A amplitude", "phase current", 1.0),
        (1.0, "A_rms", "dq current", np.sqrt(2.0)),
        (250.0, "ms", "time", 0.25),
        (250.0, "µs", "time", 250e-6),
        (1.5, "min", "time", 90.0),
        (1.5, "h", "time", 5400.0),
        (10.0, "m/s", "velocity", 36.0),
        (1.2, "m³/h", "flow", 20.0),
        (6.0, "l/min", "flow", 6.0),
        (50.0, "%", "fraction", 0.5),
    ],
)
def test_conversion(value, spelling, quantity, expected):
    # The factors are doubles: two roundings.
    assert converted(value, spelling, quantity) == pytest.approx(expected, rel=4e-16, abs=1e-13)


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


def test_case_is_kept_where_it_decides():
    assert find_unit("mw", "power") is None


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


@pytest.mark.parametrize(
    ("name", "label", "unit"),
    [
        ("T_winding [degC]", "T_winding", "degC"),
        ("Winding Temp (°C)", "Winding Temp", "°C"),
        ("Temperature (stator)", "Temperature (stator)", None),
        ("Temperature (stator) [K]", "Temperature (stator)", "K"),
        ("T (Celcius)", "T", "Celcius"),
        ("T [furlong]", "T", "furlong"),
        ("P / W", "P", "W"),
        ("n/min-1", "n", "min-1"),
        ("Speed in rpm", "Speed", "rpm"),
        ("Speed in rad/s", "Speed", "rad/s"),
        ("speed rad/s", "speed", "rad/s"),
        ("n / 1/min", "n", "1/min"),
        ("Torque, Nm", "Torque", "Nm"),
        ("torque_Nm", "torque_Nm", None),
        ("I (A rms)", "I", "A rms"),
        ("km/h", "km/h", None),
        ("", "", None),
        ("[s]", "[s]", None),
    ],
)
def test_names_with_units(name, label, unit):
    assert split_name(name) == (label, unit)


@pytest.mark.parametrize(
    ("cell", "unit"),
    [("[degC]", "degC"), ("(s)", "s"), ("rpm", "rpm"), ("", None), ("T_w", None), ("[foo]", "foo")],
)
def test_cells_of_a_row_of_units(cell, unit):
    assert unit_of_cell(cell) == unit
