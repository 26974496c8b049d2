"""A machine with a hidden cause, as the discovery sees it: motor and reduced records."""

from __future__ import annotations

from heatrun.record.motor import Motor
from heatrun.record.record import Record
from heatrun.record.reduction import reduce


def machine(hidden_bench, hidden, seed, **options):
    """Return case, motor, calibration tests and all tests.

    An amplitude in place of a target saves the bench a search of its own.
    """
    case = hidden_bench.make_case(hidden, seed, resolution_K=0.1, **options)
    motor = Motor(
        "study",
        phase_resistance_ohm=case.machine.phase_resistance_ohm,
        losses=case.losses,
        rated_speed_rpm=case.machine.rated_speed_rpm,
    )
    tests = [reduce(Record(t.name, t.columns), motor) for t in case.tests]
    fitted = [
        test for test, made in zip(tests, case.tests, strict=True) if made.role == "calibration"
    ]
    return case, motor, fitted, tests
