"""A machine with a hidden cause, as the discovery sees it: motor and reduced records."""

import numpy as np
from measured_machine import lagging

from heatrun.record.motor import Motor
from heatrun.record.record import Record
from heatrun.record.reduction import reduce


def machine(hidden_bench, hidden, seed, *, stator=False, **options):
    """Return case, motor, calibration tests and all tests.

    An amplitude in place of a target saves the bench a search of its own. With `stator`, a sensor
    of it lags by 12 s, reads 1.5 % of the rise too little and 0.3 K too high.
    """
    case = hidden_bench.make_case(hidden, seed, resolution_K=0.1, **options)
    motor = Motor(
        "study",
        phase_resistance_ohm=case.machine.phase_resistance_ohm,
        losses=case.losses,
        rated_speed_rpm=case.machine.rated_speed_rpm,
    )
    rng = np.random.default_rng([seed, 23])
    tests = []
    for made in case.tests:
        columns = dict(made.columns)
        if stator:
            sink, step = columns["ambient_degC"], float(np.median(np.diff(columns["time_s"])))
            shown = sink + 0.985 * (lagging(np.asarray(made.stator), 12.0, step) - sink) + 0.3
            noisy = shown + 0.1 * rng.standard_normal(shown.size)
            columns["stator_degC"] = 0.1 * np.rint(noisy / 0.1)
        tests.append(reduce(Record(made.name, columns), motor))
    fitted = [
        test for test, made in zip(tests, case.tests, strict=True) if made.role == "calibration"
    ]
    return case, motor, fitted, tests
