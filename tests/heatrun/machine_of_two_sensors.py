"""A machine with a hidden cause of which winding and stator are measured."""

from __future__ import annotations

import numpy as np
from measured_machine import lagging

from heatrun.record.motor import Motor
from heatrun.record.record import Record
from heatrun.record.reduction import reduce


def machine(hidden_bench, hidden, seed, **options):
    """Return case, motor, calibration tests and held-out tests.

    The stator's sensor lags by 12 s, reads 1.5 % of the rise too little and 0.3 K too high.
    """
    case = hidden_bench.make_case(hidden, seed, resolution_K=0.1, **options)
    motor = Motor(
        "study", phase_resistance_ohm=case.machine.phase_resistance_ohm, losses=case.losses,
        rated_speed_rpm=case.machine.rated_speed_rpm,
    )  # fmt: skip
    rng = np.random.default_rng([seed, 23])
    fitted, held_out = [], []
    for test in case.tests:
        columns = dict(test.columns)
        step = float(np.median(np.diff(columns["time_s"])))
        sink = columns["ambient_degC"]
        shown = lagging(np.asarray(test.stator), 12.0, step)
        shown = sink + 0.985 * (shown - sink) + 0.3 + 0.1 * rng.standard_normal(shown.size)
        columns["stator_degC"] = 0.1 * np.rint(shown / 0.1)
        rows = reduce(Record(test.name, columns), motor)
        (fitted if test.role == "calibration" else held_out).append(rows)
    return case, motor, fitted, held_out
