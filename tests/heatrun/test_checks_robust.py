"""No record, however broken, stops the checks; a long one does not hold them up."""

from __future__ import annotations

import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from heatrun.checks import check_record
from heatrun.record.motor import Motor
from heatrun.record.record import Record

CHANNELS = (
    "time_s", "phase_current_A", "losses_W", "ambient_degC", "coolant_degC", "winding_degC",
    "stator_degC", "speed_rpm",
)  # fmt: skip
MOTORS = (
    Motor("balance", phase_resistance_ohm=0.0062),
    Motor("unknown resistance"),
    Motor("map", losses="map", sink="coolant", phase_resistance_ohm=0.0062),
)
MILLION_LIMIT_S = 3.0

ANY = st.floats(allow_nan=True, allow_infinity=True)
SPECIAL = st.sampled_from([np.nan, np.inf, -np.inf, 0.0, -0.0, 1e308, -1e308, 5e-324, 20.0, 850.0])
MODERATE = st.floats(-100.0, 1000.0)


@st.composite
def records(draw):
    num = draw(st.integers(0, 80))
    keep = draw(st.sets(st.sampled_from(CHANNELS), min_size=4)) | {"time_s"}
    elements = draw(st.sampled_from([ANY, SPECIAL, MODERATE, ANY | SPECIAL | MODERATE]))
    channels = {name: draw(hnp.arrays(float, num, elements=elements)) for name in sorted(keep)}
    if draw(st.booleans()):
        channels["time_s"] = np.arange(num) * draw(st.floats(1e-3, 100.0))
    return Record("any", channels)


@given(records(), st.sampled_from(MOTORS))
def test_no_record_stops_the_checks(record, motor):
    for finding in check_record(record, motor):
        assert finding.severity in ("error", "warning", "note")
        assert finding.message
        assert finding.test == "any"


@pytest.mark.parametrize("num", [0, 1, 2, 3])
@pytest.mark.parametrize("value", [np.nan, np.inf, 25.0])
def test_tiny_record_is_an_error_not_a_crash(num, value):
    channels = {name: np.full(num, value) for name in CHANNELS}
    channels["time_s"] = np.arange(float(num))
    found = check_record(Record("tiny", channels), MOTORS[0])
    assert "too_few_samples" in {f.id for f in found if f.severity == "error"}


def test_columns_of_different_length_and_no_clock_are_errors():
    columns = {name: np.zeros(50) for name in CHANNELS}
    uneven = Record("uneven", columns | {"winding_degC": np.zeros(49)})
    clockless = Record("clockless", {k: v for k, v in columns.items() if k != "time_s"})
    for record, word in ((uneven, "winding_degC"), (clockless, "time_s")):
        (finding,) = check_record(record, MOTORS[0])
        assert (finding.id, finding.severity) == ("missing_channel", "error")
        assert word in finding.message


def test_a_million_samples_are_checked_quickly():
    rng = np.random.default_rng(5)
    num = 1_000_000
    time_s = np.arange(num) * 0.1
    current = 100.0 + 50.0 * np.sin(time_s / 300.0)
    heat = 3.0 * 0.0062 * current**2 + 200.0
    record = Record(
        "long",
        {
            "time_s": time_s,
            "phase_current_A": current,
            "losses_W": heat + rng.standard_normal(num),
            "ambient_degC": 22.0 + 0.02 * rng.standard_normal(num),
            "winding_degC": np.round(22.0 + 100.0 * -np.expm1(-time_s / 1800.0)),
            "speed_rpm": np.full(num, 3000.0),
        },
    )
    check_record(Record("warm-up", {k: v[:1000] for k, v in record.channels.items()}), MOTORS[0])
    # The processor's time, not the clock's: other work on the machine is not the checks' fault.
    begin = time.process_time()
    check_record(record, MOTORS[0])
    assert time.process_time() - begin < MILLION_LIMIT_S
