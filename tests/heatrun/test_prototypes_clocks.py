"""Clocks of several prototypes: ways that contradict each other, and pairs that share nothing."""

from __future__ import annotations

import numpy as np
import pytest

from heatrun.errors import InputError
from heatrun.motor.file import load_motor
from heatrun.record.motor import Motor
from heatrun.record.record import Record
from heatrun_reports import Reference
from heatrun_reports.prototypes.confront import confront
from heatrun_reports.prototypes.prototype import Prototype, read_prototypes
from heatrun_reports.prototypes.report import prototypes_report

MOTOR = Motor("car")
CLOCK = np.arange(0.0, 900.0)
POWER = ([0, 60, 65, 200, 204, 380, 390, 520, 523, 900], [0, 0, 8, 8, -3, -3, 5, 5, 1, 1])
SPEED = ([0, 40, 50, 150, 170, 350, 360, 600, 640, 900], [0, 0, 3, 3, 5, 5, 1, 1, 4, 4])
TORQUE = ([0, 90, 100, 300, 304, 480, 490, 700, 703, 900], [0, 0, 50, 50, 10, 10, 80, 80, 5, 5])


def logger(role: str, earlier_s: float, seed: int, **signals: float) -> Prototype:
    """A prototype whose logger started earlier; each signal lags by so many seconds."""
    rng = np.random.default_rng(seed)
    courses = {"dc_power_W": (*POWER, 1000.0), "torque_Nm": (*TORQUE, 1.0)}
    courses["speed_rpm"] = (*SPEED, 1000.0)
    channels = {"time_s": CLOCK}
    for name, lag_s in signals.items():
        times, values, scale = courses[name]
        course = scale * np.interp(CLOCK - earlier_s - lag_s, times, values)
        channels[name] = course + 0.01 * scale * rng.normal(size=CLOCK.size)
    return Prototype(role, Reference(Record(role, channels)))


def test_ways_between_clocks_that_agree_are_no_finding():
    both = {"dc_power_W": 0.0, "torque_Nm": 0.0}
    shown = [
        logger("a", 0.0, 1, **both),
        logger("b", 20.0, 2, **both),
        logger("c", -15.0, 3, **both),
    ]
    found = confront(shown, MOTOR)
    # added to the clock of each to give that of a
    assert found.shift_s["b"] == pytest.approx(-20.0, abs=0.5)
    assert found.shift_s["c"] == pytest.approx(15.0, abs=0.5)
    assert "clocks_do_not_close" not in {f.id for f in found.findings}
    # from where b and c have begun, to where the first ends, on the clock of a
    assert found.window_s == pytest.approx((15.0, 879.0), abs=1.0)


def test_ways_between_clocks_that_contradict_each_other_are_told():
    # by power and torque all clocks are one, but the speed of b lags by 30 s behind that of c
    a = logger("a", 0.0, 1, dc_power_W=0.0, torque_Nm=0.0)
    b = logger("b", 0.0, 2, dc_power_W=0.0, speed_rpm=30.0)
    c = logger("c", 0.0, 3, torque_Nm=0.0, speed_rpm=0.0)
    found = confront([a, b, c], MOTOR)
    (told,) = [f for f in found.findings if f.id == "clocks_do_not_close"]
    # what is added to the clock of b to give that of c
    assert told.values["left_s"] == pytest.approx(-30.0, abs=1.0)


def test_the_report_stands_without_a_pair_that_shares_nothing():
    a = logger("a", 0.0, 1, dc_power_W=0.0)
    b = logger("b", 0.0, 2, dc_power_W=0.0, torque_Nm=0.0)
    c = logger("c", 0.0, 3, torque_Nm=0.0)
    report = prototypes_report(MOTOR, (b, a, c))
    assert report.summary.startswith("Agree in all that is judged: a − b, c − b.")
    assert "pair_not_compared" in {f.id for f in report.findings}


def test_records_of_different_drives_are_refused():
    a = logger("a", 0.0, 1, dc_power_W=0.0)
    noise = np.random.default_rng(4).normal(size=CLOCK.size)
    other = Prototype("b", Reference(Record("b", {"time_s": CLOCK, "dc_power_W": noise})))
    with pytest.raises(InputError, match="records of one manoeuvre"):
        confront([a, other], MOTOR)


def test_the_part_that_the_motor_file_uses_is_compared(tmp_path):
    paths = []
    for role, seed in (("first", 1), ("second", 2)):
        record = logger(role, 0.0, seed, dc_power_W=0.0, torque_Nm=0.0).record
        paths.append(tmp_path / f"{role}.csv")
        table = np.stack(list(record.channels.values()), 1)
        np.savetxt(paths[-1], table, delimiter=",", comments="", header=",".join(record.channels))
    file = tmp_path / "motor.toml"
    file.write_text('[motor]\nname = "car"\n[tests.second]\nuse = [[100, 700]]\n', "utf-8")
    motor = load_motor(file)
    first, second = read_prototypes([("a", paths[0]), ("b", paths[1])], motor)
    assert first.record.duration_s == pytest.approx(899.0)
    assert second.record.duration_s == pytest.approx(600.0, abs=1.0)
