"""A test that is predicted only need not show a parameter."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest
from heat_runs import heat_run

from heatrun.calibration import Refused, load_tests
from heatrun.motor.file import load_motor
from heatrun.record.stretch import Stretch, cut

MOTOR = '[motor]\nname = "m"\nlosses = "balance"\n[winding]\nphase_resistance_ohm = 0.0062\n'


@pytest.fixture
def files(tmp_path: Path):
    (tmp_path / "motor.toml").write_text(MOTOR)
    warm = heat_run(minutes=40.0, step_s=1.0)
    long = heat_run(minutes=300.0, step_s=1.0, currents=(40.0,), noise=0.05, rounding=0.1)
    still = cut(long, Stretch(14400.0), "asked for")  # the load is on, the machine has settled
    for name, record in (("warm", warm), ("still", still)):
        table = pd.DataFrame({channel: record[channel] for channel in record.channels})
        table.to_csv(tmp_path / f"{name}.csv", index=False)
    return load_motor(tmp_path / "motor.toml"), tmp_path


def test_a_winding_that_keeps_its_temperature_is_predicted_but_not_fitted(files):
    motor, folder = files
    warm, still = folder / "warm.csv", folder / "still.csv"
    with pytest.raises(Refused) as refused:
        load_tests(motor, [warm, still])
    assert {each.id for each in refused.value.findings if each.severity == "error"} == {
        "no_heating"
    }
    tests = load_tests(motor, [warm], [still])
    (finding,) = (each for each in tests[1].findings if each.id == "no_heating")
    assert finding.severity == "warning"
    assert "how the model holds a level" in finding.message


def test_a_held_out_test_that_cannot_be_read_for_what_it_is_still_refuses(files):
    motor, folder = files
    table = pd.read_csv(folder / "still.csv").drop(columns="losses_W")
    table.to_csv(folder / "powerless.csv", index=False)
    with pytest.raises(Refused):
        load_tests(motor, [folder / "warm.csv"], [folder / "powerless.csv"])
