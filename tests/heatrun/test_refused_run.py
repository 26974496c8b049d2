"""What is refused before anything was worked out leaves no folder behind."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from heatrun.cli import main

MOTOR = '[motor]\nname = "M"\n[winding]\nphase_resistance_ohm = 0.0062\n'


@pytest.mark.parametrize("command", ["calibrate", "discover"])
def test_an_effect_without_its_channel(command, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "motor.toml").write_text(MOTOR, encoding="utf-8")
    time_s = np.arange(0.0, 3600.0, 2.0)
    is_on = time_s % 1200.0 > 300.0
    heat = np.where(is_on, 400.0, 0.0)
    winding = 22.0 + np.cumsum(heat) * 2.0 / 15000.0 * np.exp(-time_s / 3600.0)
    table = {"time_s": time_s, "phase_current_A": 80.0 * is_on, "losses_W": heat,
             "ambient_degC": 22.0, "winding_degC": winding}  # fmt: skip
    pd.DataFrame(table).to_csv("duty.csv", index=False)
    words = [command, "motor.toml", "duty.csv", "--with", "speed_cooling", "--out", "run"]
    assert main(words) == 1
    assert "speed_cooling needs the channel speed_rpm" in capsys.readouterr().err
    assert {path.name for path in tmp_path.iterdir()} == {"motor.toml", "duty.csv"}
