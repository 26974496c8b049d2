"""Bodies and coils larger than those of a bench: what their own time constants bear out is taken.

One mass each, by the exponential: nothing of the packages under test.
"""

import numpy as np
import pytest
from heat_runs import checked

from heatrun.checks.suitability import doubts
from heatrun.record.motor import Motor
from heatrun.record.record import ColumnReading, Record

ROOM = 21.0
RISES = {2.0: 400.0, 9.0: 100.0}
"""Rise that a short test is on its way to, by its minutes [K]."""
UNITS = {"time_s": "s", "losses_W": "W", "phase_current_A": "A_rms"}


def record_of(columns, unit_from="name", decided=()):
    mapping = tuple(
        ColumnReading(name, name, UNITS.get(name, "degC"), unit_from, "t", "a.csv")
        for name in columns
    )
    return Record("run", columns, mapping=mapping, decided=frozenset(decided))


def block(watts, tau_s, *, rise_K=60.0, minutes=120.0):
    """A block under a heater that is on for two thirds of the time."""
    t = np.arange(0.0, 60.0 * minutes)
    until = 40.0 * minutes
    up = -np.expm1(-np.minimum(t, until) / tau_s)
    T = ROOM + rise_K * up * np.exp(-np.maximum(t - until, 0.0) / tau_s)
    T = np.round(T + 0.05 * np.random.default_rng(1).standard_normal(t.size), 1)
    nothing = np.zeros(t.size)
    return {
        "time_s": t,
        "losses_W": np.where(t < until, watts, nothing),
        "phase_current_A": nothing,
        "ambient_degC": nothing + ROOM,
        "winding_degC": T,
    }


def found(columns, id, unit_from="name", motor=None, decided=()):
    motor = motor or Motor("block", losses="balance")
    return checked(record_of(columns, unit_from, decided), motor, id)


def test_a_block_of_half_a_megawatt_is_warned_of_and_not_refused():
    (finding,) = found(block(5e5, 7200.0), "unit_suspected")
    assert finding.severity == "warning"
    assert "2000 W/K" in finding.message
    assert 'write losses_W = "losses_W [W]": then this is only a note' in finding.remedy
    assert 'sink = "coolant"' in finding.remedy
    (finding,) = found(block(9e5, 7200.0), "unit_suspected")
    assert "coolant" not in finding.remedy  # no liquid cools so well either


def test_where_the_motor_file_decides_its_unit_it_is_a_note_and_no_doubt():
    (finding,) = found(block(5e5, 7200.0), "unit_suspected", decided={"losses_W"})
    assert finding.severity == "note"
    assert not doubts([finding])


def test_its_unit_must_be_given():
    (finding,) = found(block(5e5, 7200.0), "unit_suspected", "assumed")
    assert finding.severity == "error"


def test_a_block_of_half_a_kilowatt_whose_milliwatts_are_called_watts_is_refused():
    (finding,) = found(block(5e5, 800.0), "unit_suspected")
    assert finding.severity == "error"
    assert "mW" in finding.message


@pytest.mark.parametrize("minutes", [2.0, 9.0])
def test_heat_that_a_short_test_only_stores_is_no_absurd_conductance(minutes):
    columns = block(1e6, 7200.0, rise_K=RISES[minutes], minutes=minutes)
    assert 1e6 / float(np.ptp(columns["winding_degC"])) > 5e4
    assert not found(columns, "losses_absurd")
    # the same rise of a machine a thousand times smaller, its losses in mW
    assert found(columns | {"losses_W": 1e3 * columns["losses_W"]}, "losses_absurd")


def test_the_winding_of_a_giant_is_no_absurd_conductance_either():
    """670 kW that a test of two minutes has hardly left: 57 kW/K, of one time constant of 118 s."""
    columns = block(670e3, 118.0, rise_K=11.7, minutes=2.0)
    assert not found(columns, "losses_absurd")
    (finding,) = found(columns, "unit_suspected")
    assert finding.severity == "warning"
    # two hours show all of it
    assert found(block(1e6, 1500.0, rise_K=11.7), "losses_absurd", decided={"losses_W"})


@pytest.mark.parametrize(
    ("minutes", "unit_from", "severity"),
    [(2.0, "name", "warning"), (2.0, "assumed", "error"), (60.0, "name", "error")],
)
def test_a_test_too_short_for_more_than_the_winding_is_no_misread_clock(
    minutes, unit_from, severity
):
    columns = block(78e3, 25.0, rise_K=40.0, minutes=minutes)
    (finding,) = found(columns, "unit_suspected", unit_from)
    assert "Expected a time constant above 1100 s" in finding.message
    assert finding.severity == severity
    assert ("so short a test" in finding.remedy) == (minutes == 2.0)
    assert ("only a warning" in finding.remedy) == (severity == "error")
    assert "coolant" not in finding.remedy


def coil(below):
    """A coil under direct current, the wattmeter short of the copper loss by a share of it."""
    columns = block(2000.0, 3000.0)
    on = columns["losses_W"] > 0.0
    current = np.where(on, 20.0, 0.0)
    warm = (234.5 + columns["winding_degC"]) / 259.5
    copper = 3.0 * current**2 * warm
    return columns | {
        "phase_current_A": current, "losses_W": copper / below, "speed_rpm": np.zeros(on.size)
    }  # fmt: skip


@pytest.mark.parametrize(
    ("below", "severity"), [(1.02, None), (1.04, "warning"), (1.08, "error"), (2.0, "error")]
)
def test_losses_of_a_coil_are_refused_below_what_instruments_explain(below, severity):
    motor = Motor("coil", phase_resistance_ohm=3.0, phases=1)
    units = set(coil(below))  # else the doubt about them is told, and nothing that follows
    severities = [
        f.severity for f in found(coil(below), "losses_below_copper", "name", motor, units)
    ]
    assert severities == ([] if severity is None else [severity])
    amplitudes = found(coil(below), "current_amplitude", "name", motor, units)
    assert amplitudes == []  # the losses say it, once
