"""Numbers and units as people read them."""

from __future__ import annotations

import pytest

from heatrun.io.quantities import printed_unit, quantity, rounded


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [
        (4711.0, 3, "4710"), (10481.3, 4, "10480"), (0.01593, 4, "0.01593"), (2.4e-7, 3, "2.4e-07"),
        (0.0, 3, "0"), (-15260.0, 2, "-15000"), (3.2e9, 3, "3.2e+09"), (float("nan"), 3, "nan"),
        (float("inf"), 3, "inf"),
    ],
)  # fmt: skip
def test_numbers_have_no_exponent_where_they_are_readable(value, digits, text):
    assert rounded(value, digits) == text


def test_a_pure_number_has_no_unit():
    assert quantity("0.62", "1") == "0.62"
    assert quantity("0.0062", "ohm") == "0.0062 Ω"
    assert [printed_unit(unit) for unit in ("degC", "K/W", "J/K")] == ["°C", "K/W", "J/K"]
