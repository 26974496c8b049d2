"""The winding at switch-off and its budget beside the GUM Tree Calculator, which knows nothing of
ours: its line through the logarithms of early readings, its law of propagation for the bridge.

To first order both are right where the first reading comes early; `test_shutdown.py` holds the
budget against the draws where it comes late.
"""

import GTC
import numpy as np
import pytest

from heatrun.motor.file import parse_motor
from heatrun.shutdown.readings import read_readings
from heatrun.shutdown.result import winding_at_shutdown

B, COLD_ohm, COLD_degC, LEADS_ohm, AIR_degC = 234.5, 0.482, 21.0, 0.012, 23.0
SD = {"cold resistance": 0.003, "cold temperature": 0.3, "B of the material": 2.0, "leads": 0.2}
"""Standard uncertainties: relative, K, K, and relative."""

MOTOR = f"""[motor]
name = "GUM"
[winding]
measured_resistance_ohm = {COLD_ohm}
reference_temperature_degC = {COLD_degC}
lead_resistance_ohm = {LEADS_ohm}
[constants]
ambient_degC = {AIR_degC}
[shutdown]
cold_resistance_sd = {SD["cold resistance"]}
cold_temperature_sd_K = {SD["cold temperature"]}
coefficient_sd_degC = {SD["B of the material"]}
lead_sd = {SD["leads"]}
sink_sd_K = 0.01
moment_sd_s = 0.01
run_down_s = 0
"""

TIME_S = np.arange(2.0, 62.0, 1.0)
NOISE_K, FALL_s, RISE_K = 0.05, 900.0, 62.0


@pytest.fixture(scope="module")
def ohm():
    """What the bridge shows of a winding that cools as one with all the rest."""
    degC = AIR_degC + RISE_K * np.exp(-TIME_S / FALL_s)
    degC += np.random.default_rng(3).normal(0.0, NOISE_K, TIME_S.size)
    return (COLD_ohm - LEADS_ohm) * (B + degC) / (B + COLD_degC) + LEADS_ohm


@pytest.fixture(scope="module")
def ours(ohm, tmp_path_factory):
    path = tmp_path_factory.mktemp("gum") / "readings.csv"
    rows = [f"{t:.1f},{R:.9f}" for t, R in zip(TIME_S, ohm, strict=True)]
    path.write_text("\n".join(["time_s,R [Ohm]", *rows]) + "\n", encoding="utf-8")
    motor = parse_motor(MOTOR.encode(), "motor.toml")
    return winding_at_shutdown(motor, read_readings(path, motor, ""), seed=1)


@pytest.fixture(scope="module")
def theirs(ohm):
    """The temperature as an uncertain number, and what each source brings to it [K]."""
    end_ohm = (COLD_ohm - LEADS_ohm) * (B + AIR_degC) / (B + COLD_degC) + LEADS_ohm
    line = GTC.type_a.line_fit(TIME_S, np.log(ohm - end_ohm), label="scatter")
    hot_ohm = end_ohm + GTC.exp(line.intercept)
    cold = COLD_ohm * GTC.ureal(1.0, SD["cold resistance"], label="cold resistance")
    degC = COLD_degC + GTC.ureal(0.0, SD["cold temperature"], label="cold temperature")
    of_B = B + GTC.ureal(0.0, SD["B of the material"], label="B of the material")
    leads = LEADS_ohm * GTC.ureal(1.0, SD["leads"], label="leads")
    winding = (hot_ohm - leads) / (cold - leads) * (of_B + degC) - of_B
    return winding, {row.label: row.u for row in GTC.rp.budget(winding, trim=0)}


def test_the_temperature_is_the_same(ours, theirs):
    winding, _ = theirs
    # apart from the instruments, which both share: some hundredths of a kelvin
    assert ours.winding_degC == pytest.approx(winding.x, abs=0.1)


def test_each_instrument_brings_the_same(ours, theirs):
    _, rows = theirs
    for name in SD:
        row = next(row for row in ours.budget if row.source == name)
        assert row.contribution == pytest.approx(rows[name], rel=0.01), name


def test_the_whole_is_the_same_to_first_order_and_by_draws(ours, theirs):
    winding, rows = theirs
    # what heatrun adds is what its other exponentials leave open over two seconds
    assert rows["a_scatter"] < 0.05 * winding.u
    assert ours.gum_uncertainty_K == pytest.approx(winding.u, rel=0.02)
    assert ours.standard_uncertainty_K == pytest.approx(winding.u, rel=0.04)  # of 2000 draws
