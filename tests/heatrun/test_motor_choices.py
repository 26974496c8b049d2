"""Columns that a person may choose, and the motor file that comes of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from heatrun.init.draft import choices, draft
from heatrun.init.survey import survey
from heatrun.motor.file import parse_motor


@pytest.fixture
def surveys(tmp_path: Path):
    """A record whose logger has no name for two of its sensors."""
    t = np.arange(0.0, 3600.0, 20.0)
    load = np.where(t < 1800.0, 1.0, 0.0)
    warm = np.cumsum(load - 0.5) * 0.4
    columns = {"time [s]": t, "I_ph": 80.0 * load, "Losses [W]": 500.0 * load + 1.0,
               "Room [°C]": 21.0 + 0.001 * t,
               "Probe 7": 25.0 + warm, "Probe 8": 22.0 + 0.2 * warm}  # fmt: skip
    rows = zip(*(values.tolist() for values in columns.values()), strict=True)
    text = "\n".join((",".join(columns), *(",".join(f"{v:.3f}" for v in row) for row in rows)))
    path = tmp_path / "run.csv"
    path.write_text(text)
    return [survey(path)]


def test_a_column_is_offered_where_unit_and_name_allow_it(surveys):
    found = {each.channel: each for each in choices(surveys)}
    assert list(found)[:5] == ["time_s", "phase_current_A", "losses_W", "ambient_degC",
                               "winding_degC"]  # fmt: skip
    assert next(iter(found["losses_W"].sides)) == "Losses [W]"
    assert {"Probe 7 [degC]", "Probe 8 [degC]", "Room [°C]"} <= set(found["winding_degC"].sides)
    assert not any("Losses" in side for side in found["winding_degC"].sides)
    assert "I_ph [degC]" not in found["winding_degC"].sides


def test_what_is_chosen_stands_in_the_draft(surveys):
    chosen = {"winding_degC": "Probe 8 [degC]", "losses_W": "none", "time_s": "time [s]"}
    text = draft("m", surveys, is_accepted=True, columns=chosen)
    motor = parse_motor(text.encode(), "m")
    assert motor.columns["winding_degC"] == "Probe 8 [degC]"
    assert motor.columns["losses_W"] == "none"
    unchanged = parse_motor(draft("m", surveys, is_accepted=True).encode(), "m")
    assert "losses_W" not in unchanged.columns
