"""Rows in another order than that of time are told in one line, without what follows from it."""

from __future__ import annotations

import numpy as np
import pytest

from heatrun.checks import check_record
from heatrun.readers.read import read_record
from heatrun.record.motor import Motor

N = 240
RNG = np.random.default_rng(5)
RUN = {
    "time_s": 10.0 * np.arange(N),
    "speed_rpm": 500.0 * RNG.integers(1, 9, N) + RNG.normal(0.0, 2.0, N),
    "torque_Nm": 5.0 * RNG.integers(0, 7, N) + RNG.normal(0.0, 0.05, N),
    "phase_current_A": RNG.uniform(5.0, 60.0, N),
    "losses_W": RNG.uniform(100.0, 900.0, N),
    "ambient_degC": np.full(N, 23.0),
    "winding_degC": RNG.uniform(40.0, 110.0, N),
}
ORDERS = {
    "by speed, then torque": (
        np.lexsort((RUN["torque_Nm"], np.round(RUN["speed_rpm"], -2))),
        "speed_rpm",
    ),
    "by torque, falling": (np.argsort(-RUN["torque_Nm"]), "torque_Nm"),
    "by the temperature": (np.argsort(RUN["winding_degC"]), "winding_degC"),
    "by losses": (np.argsort(RUN["losses_W"]), "losses_W"),
    "the second half first": (np.roll(np.arange(N), N // 2), "another order"),
    "backwards": (np.arange(N)[::-1], "the last sample stands first"),
    "mixed": (RNG.permutation(N), "another order"),
}


@pytest.mark.parametrize("member", ORDERS)
def test_one_line_says_by_what_the_rows_are_sorted(tmp_path, member):
    order, word = ORDERS[member]
    path = tmp_path / "map.csv"
    columns = np.column_stack([values[order] for values in RUN.values()])
    np.savetxt(path, columns, "%.6g", ",", header=",".join(RUN), comments="")
    (finding,) = check_record(read_record(path), Motor("M", phase_resistance_ohm=0.05))
    assert (finding.id, finding.severity) == ("time_backwards", "error")
    assert word in finding.message
    assert "Sort the rows by time" in finding.remedy
