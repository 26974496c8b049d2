"""Rows of the report of a discovery."""

from __future__ import annotations

import pytest

from heatrun.reports.discovery import parameter_row
from heatrun.results.discovery import ParameterBeforeAfter, ValueWithInterval


@pytest.mark.parametrize(
    ("wrong_by", "printed"),
    [(-0.0002, "0.0 %"), (0.0003, "0.0 %"), (-0.354, "-35.4 %"), (0.246, "+24.6 %"), (None, "–")],
)
def test_a_nought_has_no_sign(wrong_by, printed):
    figure = ValueWithInterval(value=0.02701, interval_95=(0.0265, 0.0275))
    entry = ParameterBeforeAfter(before=figure, after=figure, unit="ohm", wrong_by=wrong_by)
    assert parameter_row("Rs0", entry)[-1] == printed
