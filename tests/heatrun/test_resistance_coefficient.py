"""A resistance beside a sensor in the winding says of which material the winding is."""

from __future__ import annotations

import re

import numpy as np
import pandas as pd
import pytest
from heat_runs import as_columns

from heatrun import cli
from heatrun.checks import check_record
from heatrun.record.motor import Motor
from heatrun.record.record import Record

COPPER, ALUMINIUM = 234.5, 225.0
TIME_S = np.arange(0.0, 5400.0, 2.0)
WINDING = 24.0 + 88.0 * np.where(
    TIME_S < 3600.0,
    -np.expm1(-TIME_S / 900.0),
    -np.expm1(-4.0) * np.exp(-(np.maximum(TIME_S, 3600.0) - 3600.0) / 900.0),
)
CURRENT = np.where(TIME_S < 3600.0, 34.0, 0.0)
RNG = np.random.default_rng(12)


def ohm(B=COPPER, winding=WINDING):
    """0.047 ohm at 20 degC."""
    return 0.047 * (B + winding) / (B + 20.0)


def motor(B: float, **more) -> Motor:
    return Motor(
        "M", phase_resistance_ohm=0.047, reference_temperature_degC=20.0,
        resistance_coefficient_degC=B, **more,
    )  # fmt: skip


def locked(B=COPPER, *, extra=0.0, seen=WINDING, **columns) -> Record:
    """A locked rotor under direct current for an hour, and its cooling; `extra` beside copper."""
    losses = 3.0 * (1.0 + extra) * ohm(B) * CURRENT**2
    return Record(
        "locked",
        {
            "time_s": TIME_S,
            "phase_current_A": CURRENT,
            "losses_W": losses * (1.0 + 0.002 * RNG.standard_normal(TIME_S.size)),
            "ambient_degC": np.full(TIME_S.size, 24.0),
            "winding_degC": seen + 0.1 * RNG.standard_normal(TIME_S.size),
            "speed_rpm": 0.0 * TIME_S,
            **columns,
        },
    )


def metered(B=COPPER, times=1.0, *, leads=0.0, seen=WINDING, rpm=2900.0) -> Record:
    """A record that turns, with the winding's resistance in a column of its own."""
    shown = times * ohm(B) * (1.0 + 0.001 * RNG.standard_normal(TIME_S.size)) + leads
    turning = dict(locked(B, extra=0.6, seen=seen, winding_resistance_ohm=shown).channels)
    turning["speed_rpm"] = np.where(CURRENT > 0.0, rpm, 0.0)
    return as_columns(Record("metered", turning))


def doubts(record: Record, machine: Motor) -> list:
    return [one for one in check_record(record, machine) if one.severity != "note"]


USUAL = 'material = "copper" or "aluminium"'


@pytest.mark.parametrize(
    ("record", "B", "true", "says"),
    [
        (locked(), 150.0, COPPER, USUAL),
        (locked(), 334.5, COPPER, USUAL),
        (locked(390.0), COPPER, 390.0, "resistance_coefficient_degC = 39"),
        (metered(), 160.0, COPPER, USUAL),
        (metered(ALUMINIUM, 2.0), 310.0, ALUMINIUM, USUAL),
    ],
    ids=["locked, low", "locked, high", "no usual material", "meter, low", "meter, high"],
)
def test_a_wrong_coefficient_is_told_once_and_first(record, B, true, says):
    (finding,) = doubts(record, motor(B))
    assert (finding.id, finding.severity) == ("resistance_coefficient", "warning")
    assert says in finding.remedy
    assert f"B = {B:g} °C" in finding.message
    assert finding.values["coefficient_degC"] == pytest.approx(true, abs=5.0)


@pytest.mark.parametrize("B", [COPPER, ALUMINIUM])
@pytest.mark.parametrize("gain", [0.95, 1.0, 1.06])
def test_what_a_sensor_may_show_beside_the_mean_accuses_nobody(B, gain):
    seen = 24.0 + gain * (WINDING - 24.0)
    for record in (locked(B, seen=seen), metered(B, seen=seen)):
        ids = {one.id for one in check_record(record, motor(B))}
        assert "resistance_coefficient" not in ids


def test_a_small_rise_tells_nothing():
    little = 24.0 + 0.05 * (WINDING - 24.0)
    record = locked(seen=little, losses_W=3.0 * ohm(winding=little) * CURRENT**2
                    * (1.0 + 0.01 * RNG.standard_normal(TIME_S.size)))  # fmt: skip
    assert "resistance_coefficient" not in {one.id for one in check_record(record, motor(150.0))}


def test_losses_beside_the_copper_are_no_matter_of_the_material():
    ids = {one.id for one in check_record(locked(extra=0.5), motor(COPPER))}
    assert "resistance_coefficient" not in ids


def test_leads_that_stay_cold_are_named():
    record = metered(leads=0.02)
    (finding,) = doubts(record, motor(COPPER))
    (said,) = re.findall(r"lead_resistance_ohm = ([0-9.]*[0-9])", finding.remedy)
    assert float(said) == pytest.approx(0.02, abs=0.002)
    assert doubts(record, motor(COPPER, lead_resistance_ohm=0.02)) == []


def test_the_command_names_the_line_to_write(tmp_path, capsys):
    record = locked()
    table = {"t [s]": TIME_S, "I [A]": CURRENT, "P [W]": record["losses_W"],
             "T [°C]": record["winding_degC"], "room [°C]": record["ambient_degC"]}  # fmt: skip
    pd.DataFrame(table).to_csv(tmp_path / "locked.csv", index=False)
    (tmp_path / "m.toml").write_text(
        '[motor]\nname = "M"\n[winding]\nphase_resistance_ohm = 0.047\n'
        "reference_temperature_degC = 20\nresistance_coefficient_degC = 120\n"
        '[columns]\ntime_s = "t [s]"\nphase_current_A = "I [A_rms]"\nlosses_W = "P"\n'
        'winding_degC = "T"\nambient_degC = "room"\n[constants]\nspeed_rpm = 0\n',
        encoding="utf-8",
    )
    cli.main(["check", str(tmp_path / "m.toml"), str(tmp_path / "locked.csv")])
    printed = capsys.readouterr().out
    assert "(resistance_coefficient)" in printed
    assert "(losses_below_copper)" not in printed
    assert "(standstill_losses)" not in printed
